"""What a live map shows, as plain shapes: people with their 95 % ellipses; anchors, galleries, zones, vehicles."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mine_loc_core.gates import chi2_quantile
from mine_loc_core.site import Gallery, Site
from mine_loc_fusion.mode import Mode
from mine_loc_fusion.possible_presence import KNOWN_MODES, SeenPerson
from mine_loc_fusion.proximity import Pose2, ProximityZone, placed_body
from mine_loc_fusion.zone_shape import Array, ZoneShape

Colour = tuple[float, float, float, float]
GREY: Colour = (0.6, 0.6, 0.6, 1.0)
ROCK: Colour = (0.5, 0.4, 0.3, 0.5)
BLUE: Colour = (0.2, 0.5, 1.0, 1.0)
GREEN: Colour = (0.1, 0.8, 0.2, 0.6)
YELLOW: Colour = (1.0, 0.8, 0.0, 0.8)
RED: Colour = (1.0, 0.1, 0.1, 0.8)
WHITE: Colour = (1.0, 1.0, 1.0, 1.0)

_WIDEST_ELLIPSE_M = 200.0
_CORNER_STEPS = 48
_LINE_M, _ANCHOR_M, _TEXT_M, _ELLIPSE_HEIGHT_M = 0.08, 0.3, 0.6, 0.05


@dataclass(frozen=True, slots=True)
class Drawing:
    """One shape in the map: `kind` box or cylinder of `size_m` at `position_m` turned by `yaw_rad`; a line through
    `points_m` (n, 3), `size_m[0]` wide; or `text`, `size_m[2]` high. `group` and `name` together are its own.
    """

    group: str
    name: str
    kind: Literal["box", "cylinder", "line", "text"]
    colour: Colour
    position_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    yaw_rad: float = 0.0
    size_m: tuple[float, float, float] = (_LINE_M, _LINE_M, _LINE_M)
    points_m: Array | None = None
    text: str = ""


def draw_site(site: Site, zones: tuple[ProximityZone, ...]) -> Iterator[Drawing]:
    """Everything that does not move: galleries, chambers, obstacles, anchors of the place, zones of the map."""
    for gallery in site.galleries:
        yield _gallery(gallery)
    for group, parts, colour in (("chambers", site.chambers, ROCK), ("obstacles", site.obstacles, GREY)):
        for part in parts:
            yield _ring(group, part.id, np.array(part.polygon_m), colour, part.floor_m)
    for anchor in site.fixed_anchors:
        size_m = (_ANCHOR_M, _ANCHOR_M, _ANCHOR_M)
        yield Drawing("anchors", str(anchor.id), "box", BLUE, anchor.position_m, size_m=size_m)
        yield _label("anchor names", str(anchor.id), anchor.position_m, anchor.name)
    for zone in site.zones:
        if zone.vehicle is None:
            yield _ring("zones", zone.id, np.array(zone.polygon_m), WHITE)
    yield from draw_zones(tuple(zone for zone in zones if zone.vehicle is None), {})


def draw_zones(zones: tuple[ProximityZone, ...], vehicles: Mapping[str, Pose2]) -> Iterator[Drawing]:
    """Borders of warning and danger zones whose place is known."""
    for zone in zones:
        body = placed_body(zone, vehicles)
        for group, margin_m, colour in (("warning", zone.warning_m, YELLOW), ("danger", zone.danger_m, RED)):
            if body is not None and margin_m is not None:
                yield _ring(group, zone.id, border(body.widened(margin_m)), colour)


def draw_vehicles(site: Site, vehicles: Mapping[str, Pose2]) -> Iterator[Drawing]:
    """Bodies of the vehicles whose place is known."""
    for vehicle in site.vehicles:
        pose = vehicles.get(vehicle.id)
        if pose is not None:
            height_m = vehicle.size_m[2]
            position = (pose.x_m, pose.y_m, vehicle.position_m[2] + 0.5 * height_m)
            yield Drawing("vehicles", vehicle.id, "box", YELLOW, position, pose.yaw_rad, vehicle.size_m)
            yield _label("vehicle names", vehicle.id, (pose.x_m, pose.y_m, position[2] + height_m), vehicle.id)


def draw_person(seen: SeenPerson, height_m: float) -> Iterator[Drawing]:
    """The ellipse that holds the person with probability 0.95, green where they are measured, red where unknown."""
    if not seen.stated:
        return
    variances, axes = np.linalg.eigh(seen.covariance_m2)
    widths = 2.0 * np.sqrt(np.maximum(variances, 0.0) * chi2_quantile(0.95, 2))
    minor, major = (min(float(width), _WIDEST_ELLIPSE_M) for width in widths)
    measured = seen.mode in {Mode.UWB_PDR, Mode.UWB_ONLY}
    colour = GREEN if measured else YELLOW if seen.mode in KNOWN_MODES else RED
    position = (float(seen.mean_m[0]), float(seen.mean_m[1]), height_m)
    yaw = math.atan2(axes[1, 1], axes[0, 1])
    yield Drawing("people", seen.person, "cylinder", colour, position, yaw, (major, minor, _ELLIPSE_HEIGHT_M))
    yield _label("names", seen.person, (position[0], position[1], height_m + 1.0), f"{seen.person} {seen.mode.name}")


def border(shape: ZoneShape) -> Array:
    """Points (n, 2) of a zone's border, counter-clockwise; of a polygon that is not convex, of its hull."""
    if shape.margin_m == 0.0:
        return shape.polygon_m
    angle = np.linspace(0.0, 2.0 * math.pi, _CORNER_STEPS, endpoint=False)
    normal = np.column_stack([np.cos(angle), np.sin(angle)])
    foremost = shape.polygon_m[np.argmax(shape.polygon_m @ normal.T, axis=0)]
    found: Array = foremost + shape.margin_m * normal
    return found


def _gallery(gallery: Gallery) -> Drawing:
    points = np.array(gallery.centre_line_m, dtype=float)
    return Drawing("galleries", gallery.id, "line", ROCK, size_m=(gallery.width_m, 0.0, 0.0), points_m=points)


def _ring(group: str, name: str, polygon_m: Array, colour: Colour, z_m: float = 0.0) -> Drawing:
    closed = np.vstack([polygon_m, polygon_m[:1]])
    return Drawing(group, name, "line", colour, points_m=np.column_stack([closed, np.full(len(closed), z_m)]))


def _label(group: str, name: str, position_m: tuple[float, float, float], text: str) -> Drawing:
    return Drawing(group, name, "text", WHITE, position_m, size_m=(0.0, 0.0, _TEXT_M), text=text)
