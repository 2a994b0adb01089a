"""A site file's galleries, chambers, obstacles and vehicles as radio sees them."""

from dataclasses import replace

import numpy as np

from mine_loc_core.site import Chamber, Obstacle, Site, Vehicle
from mine_loc_sim.mine import Mine, gallery_prisms
from mine_loc_sim.prism import ConvexPrisms, Floats, Prism, contains

_EYE_LEVEL_M = 1.5
"""Ways round a corner are followed at this height over the floor, or at half the height of a low gallery."""
_NO_WAY_OVER_M = 1e6


def mine_of(site: Site) -> Mine:
    """Build the mine without its vehicles, which move: see `vehicle_prism`."""
    free = [
        prism
        for gallery in site.galleries
        for prism in gallery_prisms(gallery.centre_line_m, gallery.width_m, gallery.height_m)
    ]
    free += [_prism(chamber) for chamber in site.chambers]
    obstacles = tuple(_to_the_roof(_prism(obstacle, obstacle.material), free) for obstacle in site.obstacles)
    return Mine.build(free, obstacles, _turning_points(site))


def vehicle_prism(vehicle: Vehicle, x_m: float, y_m: float, floor_m: float, yaw_rad: float) -> Prism:
    """A vehicle's body, of steel, with the middle of its floor at (x, y), map frame."""
    length, width, height = vehicle.size_m
    corners = 0.5 * np.array([[length, width], [-length, width], [-length, -width], [length, -width]])
    cos, sin = np.cos(yaw_rad), np.sin(yaw_rad)
    turned = corners @ np.array([[cos, sin], [-sin, cos]])
    return Prism(turned + np.array([x_m, y_m]), floor_m, floor_m + height, "steel")


def _prism(part: Chamber | Obstacle, material: str = "") -> Prism:
    return Prism(np.array(part.polygon_m), part.floor_m, part.floor_m + part.height_m, material)


def _to_the_roof(obstacle: Prism, free: list[Prism]) -> Prism:
    """Close the gap over an obstacle that reaches the roof, so that no way leads over it."""
    middle = np.array([[*obstacle.polygon_m.mean(axis=0), obstacle.floor_m]])
    roofs = [room.top_m for room in free if contains(ConvexPrisms.of([room]), middle)[0]]
    return replace(obstacle, top_m=_NO_WAY_OVER_M) if roofs and obstacle.top_m >= max(roofs) else obstacle


def _turning_points(site: Site) -> Floats:
    """Vertices of the centre lines and middles of the chambers."""
    points = [
        (x, y, z + min(_EYE_LEVEL_M, 0.5 * gallery.height_m))
        for gallery in site.galleries
        for x, y, z in gallery.centre_line_m
    ]
    for chamber in site.chambers:
        x, y = np.mean(chamber.polygon_m, axis=0)
        points.append((x, y, chamber.floor_m + min(_EYE_LEVEL_M, 0.5 * chamber.height_m)))
    return np.unique(np.array(points, float).reshape(-1, 3), axis=0)
