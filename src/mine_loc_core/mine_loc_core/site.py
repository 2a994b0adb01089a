"""The site file `site.yaml`: what a place is made of and where the hardware hangs.

Frame: the site's map, ENU (REP 103): x east, y north, z up, metres. Angles: counter-clockwise, radians in memory,
degrees in the file (its keys end in `_deg`). The published schema is `schema/site.schema.json`.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any, Literal

from mine_loc_core.site_checks import contradictions
from mine_loc_core.yaml_schema import check_schema, device_id, read_schema
from mine_loc_core.yaml_source import load_yaml, refuse

Point2 = tuple[float, float]
Point3 = tuple[float, float, float]
Material = Literal["rock", "steel", "concrete", "wood", "water"]
RelayOutput = Literal["modbus_tcp", "modbus_rtu", "dtr", "rts"]
WireFormat = Literal["auto", "trek1000", "dwm1001_shell", "dwm1001_tlv", "arduino", "nlink", "mine_loc"]


class ZoneType(IntEnum):
    """The same numbers as in mine_loc_interfaces/ZoneEvent."""

    GENERAL = 1
    KEY = 2
    RESTRICTED = 3
    PERMITTED = 4
    HAZARD_NEAR = 5
    REFUGE = 6
    PORTAL = 7


@dataclass(frozen=True, slots=True)
class Anchor:
    """A UWB anchor. An anchor that a vehicle carries is placed in the vehicle's frame, any other in the map."""

    id: int
    name: str
    position_m: Point3
    position_sd_m: float
    range_offset_m: float


@dataclass(frozen=True, slots=True)
class Gallery:
    """A tunnel along a centre line that runs on its floor."""

    id: str
    centre_line_m: tuple[Point3, ...]
    width_m: float
    height_m: float


@dataclass(frozen=True, slots=True)
class Chamber:
    """A hollow with a polygon for ground plan."""

    id: str
    polygon_m: tuple[Point2, ...]
    floor_m: float
    height_m: float


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A body that weakens or stops radio, a prism over a polygon."""

    id: str
    polygon_m: tuple[Point2, ...]
    floor_m: float
    height_m: float
    material: Material


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A box on wheels. Its frame (FLU) has the origin on the floor below its middle, at first at `position_m`.

    One that `stands` never leaves that place; any other tells its pose.
    """

    id: str
    size_m: Point3
    position_m: Point3
    yaw_rad: float
    anchor_ids: tuple[int, ...]
    stands: bool = False


@dataclass(frozen=True, slots=True)
class TurnMarker:
    """A place where people turn, the turn angles that are possible there, and how near counts as there (paper B)."""

    id: str
    position_m: Point3
    angles_rad: tuple[float, ...]
    radius_m: float


@dataclass(frozen=True, slots=True)
class Zone:
    """An area whose entering and leaving is reported.

    One that a `vehicle` carries has its corners in that vehicle's frame, without corners those of the vehicle's body.
    Within `warning_m` and `danger_m` of it people are warned of, and in danger; None = no such distance.
    """

    id: str
    name: str
    type: ZoneType
    polygon_m: tuple[Point2, ...]
    vehicle: str | None = None
    warning_m: float | None = None
    danger_m: float | None = None


@dataclass(frozen=True, slots=True)
class Monitor:
    """A direction-finding monitor (paper E). `port` is its serial line or TCP address, empty = read elsewhere."""

    id: int
    position_m: Point3
    port: str = ""
    baud: int = 115200


@dataclass(frozen=True, slots=True)
class UwbReceiver:
    """A serial line that brings ranges.

    `anchor_id` is set when it is an anchor's, `tag_id` (0 = not) where the wire format does not name the tag.
    """

    name: str
    port: str
    format: WireFormat
    baud: int
    anchor_id: int | None = None
    tag_id: int = 0


@dataclass(frozen=True, slots=True)
class Relay:
    """Outputs that hold a vehicle: energised while it may run, on a Modbus device or a serial port's control line."""

    name: str
    vehicle: str
    output: RelayOutput
    port: str
    baud: int
    unit: int
    coils: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Discovery:
    """How far ROS 2 looks for other nodes, and hosts it looks for them on besides."""

    range: Literal["localhost", "subnet", "off"] = "localhost"
    peers: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Site:
    """All of a site file."""

    name: str
    map_frame: str
    dimensions: Literal[2, 3]
    tag_height_m: float
    anchors: tuple[Anchor, ...] = ()
    galleries: tuple[Gallery, ...] = ()
    chambers: tuple[Chamber, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    vehicles: tuple[Vehicle, ...] = ()
    turn_markers: tuple[TurnMarker, ...] = ()
    zones: tuple[Zone, ...] = ()
    monitors: tuple[Monitor, ...] = ()
    uwb_receivers: tuple[UwbReceiver, ...] = ()
    relays: tuple[Relay, ...] = ()
    discovery: Discovery = Discovery()

    @property
    def fixed_anchors(self) -> tuple[Anchor, ...]:
        """The anchors that no vehicle carries: those placed in the map."""
        carried = {anchor for vehicle in self.vehicles for anchor in vehicle.anchor_ids}
        return tuple(anchor for anchor in self.anchors if anchor.id not in carried)


def load_site(folder: Path) -> Site:
    """Read and check `site.yaml` in `folder`.

    Raises ConfigurationError with one line a mistake, naming file, line, key, value and what is allowed.
    """
    source = load_yaml(folder / "site.yaml")
    check_schema(source, read_schema("site"))
    refuse(contradictions(source))
    return _site(source.content)


def _site(content: Mapping[str, Any]) -> Site:
    def every(section: str, build: Callable[[Mapping[str, Any]], Any]) -> tuple[Any, ...]:
        return tuple(build(item) for item in content.get(section, []))

    discovery = content.get("discovery", {})
    return Site(
        name=content["name"],
        map_frame=content.get("map_frame", "map"),
        dimensions=content["dimensions"],
        tag_height_m=float(content["tag_height_m"]),
        anchors=every("anchors", _anchor),
        galleries=every(
            "galleries",
            lambda g: Gallery(g["id"], _points(g["centre_line_m"]), float(g["width_m"]), float(g["height_m"])),
        ),
        chambers=every("chambers", lambda c: Chamber(c["id"], *_prism(c))),
        obstacles=every("obstacles", lambda o: Obstacle(o["id"], *_prism(o), o["material"])),
        vehicles=every("vehicles", _vehicle),
        turn_markers=every("turn_markers", _turn_marker),
        zones=every("zones", _zone),
        monitors=every("monitors", _monitor),
        uwb_receivers=every("uwb_receivers", _uwb_receiver),
        relays=every("relays", _relay),
        discovery=Discovery(discovery.get("range", "localhost"), tuple(discovery.get("peers", []))),
    )


def _point(values: list[float]) -> Any:
    return tuple(float(value) for value in values)


def _points(values: list[list[float]]) -> tuple[Any, ...]:
    return tuple(_point(value) for value in values)


def _prism(item: Mapping[str, Any]) -> tuple[tuple[Point2, ...], float, float]:
    return _points(item["polygon_m"]), float(item.get("floor_m", 0.0)), float(item["height_m"])


def _anchor(item: Mapping[str, Any]) -> Anchor:
    return Anchor(
        id=device_id(item["id"]),
        name=item.get("name", f"anchor {item['id']}"),
        position_m=_point(item["position_m"]),
        position_sd_m=float(item.get("position_sd_m", 0.0)),
        range_offset_m=float(item.get("range_offset_m", 0.0)),
    )


def _vehicle(item: Mapping[str, Any]) -> Vehicle:
    return Vehicle(
        id=item["id"],
        size_m=_point(item["size_m"]),
        position_m=_point(item.get("position_m", [0, 0, 0])),
        yaw_rad=math.radians(item.get("yaw_deg", 0.0)),
        anchor_ids=tuple(device_id(anchor) for anchor in item.get("anchors", [])),
        stands=item.get("stands", False),
    )


def _zone(item: Mapping[str, Any]) -> Zone:
    distances = [float(item[key]) if key in item else None for key in ("warning_m", "danger_m")]
    corners, kind = _points(item.get("polygon_m", [])), ZoneType[item["type"].upper()]
    return Zone(item["id"], item.get("name", item["id"]), kind, corners, item.get("vehicle"), *distances)


def _monitor(item: Mapping[str, Any]) -> Monitor:
    return Monitor(item["id"], _point(item["position_m"]), item.get("port", ""), item.get("baud", 115200))


def _turn_marker(item: Mapping[str, Any]) -> TurnMarker:
    angles = tuple(math.radians(angle) for angle in item["angles_deg"])
    return TurnMarker(item["id"], _point(item["position_m"]), angles, float(item["radius_m"]))


def _uwb_receiver(item: Mapping[str, Any]) -> UwbReceiver:
    anchor = device_id(item["anchor"]) if "anchor" in item else None
    tag = device_id(item["tag"]) if "tag" in item else 0
    return UwbReceiver(item["name"], item["port"], item.get("format", "auto"), item.get("baud", 115200), anchor, tag)


def _relay(item: Mapping[str, Any]) -> Relay:
    coils = tuple(item.get("coils", [0]))
    return Relay(
        item["name"], item["vehicle"], item["output"], item["port"], item.get("baud", 9600), item.get("unit", 1), coils
    )
