"""The demonstration's own site folder: a shipped one with its ports replaced by the played lines."""

import shutil
from collections.abc import Mapping
from pathlib import Path

import yaml


def write_site_folder(source: Path, target: Path, ports: Mapping[str, Path]) -> None:
    """Copy `source` to `target`; `ports` names the line of each receiver (`name`) and N100 (`person/n100`)."""
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(source, target)
    site = yaml.safe_load((source / "site.yaml").read_text("utf-8"))
    for receiver in site.get("uwb_receivers", []):
        receiver["port"] = str(ports[receiver["name"]])
    people = yaml.safe_load((source / "people.yaml").read_text("utf-8"))
    for person in people["people"]:
        if "n100" in person:
            person["n100"]["port"] = str(ports[f"{person['name']}/n100"])
    (target / "site.yaml").write_text(yaml.safe_dump(site, sort_keys=False), "utf-8")
    (target / "people.yaml").write_text(yaml.safe_dump(people, sort_keys=False), "utf-8")
