#!/usr/bin/env bash
# Brings the checkout to a state in which everything runs: virtual environment, ROS wheels, built workspace.
# Writes inside the checkout only; safe to interrupt and to repeat (a repeat does nothing when nothing changed).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
root=$PWD

export PIP_CACHE_DIR=$root/build/pip-cache PIP_DISABLE_PIP_VERSION_CHECK=1 COLCON_HOME=$root/build/colcon
mkdir -p build
exec 9> build/setup.lock
flock 9

missing() {
    echo "setup: $1 is missing: install the package $2 (Debian/Ubuntu: apt install $2)" >&2
    exit 1
}

find_python() {
    local candidate
    for candidate in "${PYTHON:-}" python3.12 python3.11 python3; do
        [ -n "$candidate" ] || continue
        "$candidate" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 12))' 2>/dev/null && { echo "$candidate"; return; }
    done
    missing "Python 3.11 or 3.12" python3
}

check_prerequisites() {
    [ "$(uname -sm)" = "Linux x86_64" ] || { echo "setup: the ROS wheels exist for Linux x86_64 only; elsewhere use a full ROS 2 Jazzy (docs/hardware.md)" >&2; exit 1; }
    command -v g++ > /dev/null || missing "a C++ compiler" g++
    command -v make > /dev/null || missing make make
    command -v setpriv > /dev/null || missing setpriv util-linux
    "$1" -c 'import ensurepip, venv' 2>/dev/null || missing "the venv module of $1" python3-venv
    [ -f "$("$1" -c 'import sysconfig; print(sysconfig.get_path("include"))')/Python.h" ] || missing "Python.h" python3-dev
}

# The stamp names what the environment was made from, and where: a moved checkout or a changed pin makes it anew.
wanted_environment() {
    { echo "$root"; "$1" --version; cat requirements.txt tools/setup.sh; } | sha256sum
}

make_environment() {
    local python=$1 wanted=$2
    if [ -d .venv ] && ! .venv/bin/python -m pip --version > /dev/null 2>&1; then rm -rf .venv; fi
    rm -f .venv/made-from
    echo "setup: installing Python packages into .venv (once, about a minute)"
    "$python" -m venv .venv
    .venv/bin/python -m pip install --quiet --requirement requirements.txt
    mend_cmake_exports
    echo "$wanted" > .venv/made-from
}

# The wheels' CMake exports hold the Python paths of the machine they were built on.
mend_cmake_exports() {
    local include purelib
    include=$(.venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("include"))')
    purelib=$(.venv/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')
    find .venv -path '*/share/*' -name '*.cmake' -print0 | xargs -0 sed -Ei \
        -e "s#/opt/python/cp[0-9]+-cp[0-9]+/include/python3\.[0-9]+#$include#g" \
        -e "s#/opt/python/cp[0-9]+-cp[0-9]+/lib/python3\.[0-9]+/site-packages#$purelib#g"
}

# What a build depends on: interfaces, package manifests and set-up files. Python sources are linked, not copied.
wanted_workspace() {
    { cat .venv/made-from
      find src ros_ws/pip_only -type f \( -path '*/msg/*' -o -path '*/srv/*' -o -name package.xml -o -name 'setup.*' -o -name CMakeLists.txt \
          -o -path '*/launch/*' \) -print0 | sort -z | xargs -0 sha256sum
      find src -name '*.py' -o -name '*.yaml' | sort; } | sha256sum
}

# The solvers' compiled code is cached beside their sources; without this the first node to start would wait for it.
compile_solvers() (
    set +u  # the workspace's own set-up reads unset variables
    # shellcheck disable=SC1091
    . ./env.sh
    python -c 'from mine_loc_uwb import parameters, round_solver; round_solver.rehearse(parameters.UwbSolverParameters(), 2)'
    python -c 'from mine_loc_fusion.tightly_coupled import rehearse; rehearse(2)'
)

build_workspace() {
    local wanted=$1
    rm -f ros_ws/install/made-from
    echo "setup: building the ROS workspace"
    (   # shellcheck disable=SC1091
        . .venv/bin/activate
        cd ros_ws
        export AMENT_PREFIX_PATH=$VIRTUAL_ENV CMAKE_PREFIX_PATH=$VIRTUAL_ENV LD_LIBRARY_PATH=$VIRTUAL_ENV/lib MAKEFLAGS=-j$(nproc)
        COLCON_DEFAULTS_FILE=colcon.yaml colcon build
    )
    compile_solvers
    echo "$wanted" > ros_ws/install/made-from
}

python=$(find_python) || exit 1
check_prerequisites "$python"
wanted=$(wanted_environment "$python")
[ "$(cat .venv/made-from 2>/dev/null)" = "$wanted" ] || make_environment "$python" "$wanted"
wanted=$(wanted_workspace)
[ "$(cat ros_ws/install/made-from 2>/dev/null)" = "$wanted" ] || build_workspace "$wanted"
