"""A site folder for a run on other lines than the site's own: a shipped one with its ports and people replaced."""

import dataclasses
import math
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from mine_loc_core.people import Person


def write_site_folder(
    source: Path, target: Path, ports: Mapping[str, str], people: Sequence[Person] | None = None
) -> None:
    """Copy `source` to `target`; `ports` names the line of each receiver (`name`) and N100 (`person/n100`).

    With `people`, these are written in place of the source's.
    """
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(source, target)
    site = yaml.safe_load((source / "site.yaml").read_text("utf-8"))
    for receiver in site.get("uwb_receivers", []):
        receiver["port"] = ports[receiver["name"]]
    crew = yaml.safe_load((source / "people.yaml").read_text("utf-8"))
    if people is not None:
        crew["people"] = [_item(person) for person in people]
    for person in crew["people"]:
        if "n100" in person:
            person["n100"]["port"] = ports[f"{person['name']}/n100"]
    (target / "site.yaml").write_text(yaml.safe_dump(site, sort_keys=False), "utf-8")
    (target / "people.yaml").write_text(yaml.safe_dump(crew, sort_keys=False), "utf-8")


def _item(person: Person) -> dict[str, Any]:
    item: dict[str, Any] = {"name": person.name, "tag_id": person.tag_id, "height_m": person.height_m}
    item["stride"] = dataclasses.asdict(person.stride)
    if person.tag_height_m is not None:
        item["tag_height_m"] = person.tag_height_m
    if person.n100 is not None:
        mounting = [math.degrees(angle) for angle in person.n100.mounting_rpy_rad]
        item["n100"] = {"port": person.n100.port, "baud": person.n100.baud, "mounting_rpy_deg": mounting}
    return item
