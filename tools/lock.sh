#!/usr/bin/env bash
# Resolves requirements.in into the pinned requirements.txt.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export PIP_CACHE_DIR=$PWD/build/pip-cache PIP_DISABLE_PIP_VERSION_CHECK=1
mkdir -p build
# Not `pip freeze`: the ROS wheels carry the metadata of the packages inside them, which PyPI does not have.
.venv/bin/python -m pip install --quiet --dry-run --ignore-installed --report build/resolved.json --requirement requirements.in
.venv/bin/python - build/resolved.json > build/requirements.txt << 'PYTHON'
import json, sys
print("# Made from requirements.in by `make lock`: do not edit by hand.")
packages = [item["metadata"] for item in json.load(open(sys.argv[1]))["install"]]
# Without the local part of a version ("+cpu"), which an index of its own adds.
print(*sorted(f"{package['name']}=={package['version'].split('+')[0]}" for package in packages), sep="\n")
PYTHON
mv build/requirements.txt requirements.txt
