"""What no schema can see in a site file: names given twice, references to nothing, impossible geometry."""

import itertools
import math
from collections.abc import Iterator

import numpy as np

from mine_loc_core.site_checks_proximity import relay_contradictions, zone_contradictions
from mine_loc_core.yaml_schema import device_id, twice
from mine_loc_core.yaml_source import KeyPath, YamlSource

DW1000_REACH_M = 290.0  # DW1000 data sheet, title page: range at 110 kbit/s in line of sight
SAME_PLACE_M = 0.05


def contradictions(source: YamlSource) -> Iterator[str]:
    """One line for each; the file has passed its schema."""
    content = source.content
    for section in ("anchors", "galleries", "chambers", "obstacles", "vehicles", "turn_markers", "zones", "monitors"):
        yield from twice(source, section, ("id",), device_id if section == "anchors" else str)
    yield from twice(source, "uwb_receivers", ("name",))
    yield from twice(source, "uwb_receivers", ("port",))
    yield from twice(source, "relays", ("name",))
    yield from _unknown_anchors(source)
    yield from zone_contradictions(source)
    yield from relay_contradictions(source)
    for index, gallery in enumerate(content.get("galleries", [])):
        line = gallery["centre_line_m"]
        if sum(math.dist(a, b) for a, b in itertools.pairwise(line)) == 0:
            yield source.problem(
                ("galleries", index, "centre_line_m"), "has length 0; allowed: at least two different points"
            )
    for section in ("chambers", "obstacles", "zones"):
        for index, item in enumerate(content.get(section, [])):
            if "polygon_m" in item and _area_m2(item["polygon_m"]) == 0:
                yield source.problem((section, index, "polygon_m"), "has area 0; allowed: corners that enclose an area")
    yield from _misplaced_anchors(source)


def _unknown_anchors(source: YamlSource) -> Iterator[str]:
    known = {device_id(anchor["id"]) for anchor in source.content.get("anchors", [])}
    references: list[tuple[KeyPath, int | str]] = [
        (("vehicles", index, "anchors", place), anchor)
        for index, vehicle in enumerate(source.content.get("vehicles", []))
        for place, anchor in enumerate(vehicle.get("anchors", []))
    ]
    references += [
        (("uwb_receivers", index, "anchor"), receiver["anchor"])
        for index, receiver in enumerate(source.content.get("uwb_receivers", []))
        if "anchor" in receiver
    ]
    for path, anchor in references:
        if device_id(anchor) not in known:
            allowed = (
                ", ".join(str(item["id"]) for item in source.content.get("anchors", [])) or "none, as anchors is empty"
            )
            yield source.problem(path, f"{anchor!r} is no anchor of this site; allowed: {allowed}")


def _misplaced_anchors(source: YamlSource) -> Iterator[str]:
    """Anchors in one place, or all out of each other's reach, which is how a wrong unit looks."""
    carried = {device_id(a) for vehicle in source.content.get("vehicles", []) for a in vehicle.get("anchors", [])}
    fixed = [
        (index, anchor["position_m"])
        for index, anchor in enumerate(source.content.get("anchors", []))
        if device_id(anchor["id"]) not in carried
    ]
    if len(fixed) < 2:
        return
    places = np.array([place for _, place in fixed], dtype=float)
    nearest_m = []
    for row, (index, place) in enumerate(fixed):
        distances_m = np.linalg.norm(places - places[row], axis=1)
        distances_m[row] = np.inf
        other = int(distances_m.argmin())
        nearest_m.append(distances_m[other])
        if distances_m[other] < SAME_PLACE_M and other < row:
            problem = (
                f"{place} is within {SAME_PLACE_M} m of anchors[{fixed[other][0]}]; allowed: anchors apart, in metres"
            )
            yield source.problem(("anchors", index, "position_m"), problem)
    if min(nearest_m) > DW1000_REACH_M:
        problem = (
            f"no anchor is within {DW1000_REACH_M:g} m of another; "
            "allowed: coordinates in metres (are these millimetres?)"
        )
        yield source.problem(("anchors",), problem)


def _area_m2(polygon: list[list[float]]) -> float:
    turned = polygon[1:] + polygon[:1]
    return abs(sum(a[0] * b[1] - b[0] * a[1] for a, b in zip(polygon, turned, strict=True))) / 2
