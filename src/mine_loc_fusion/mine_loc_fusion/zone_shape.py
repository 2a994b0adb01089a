"""The ground plan of a zone: a polygon and everything within a distance of it."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mine_loc_core.polygon import is_inside, nearest_on_border

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ZoneShape:
    """All points within `margin_m` [m] of the polygon `polygon_m` (k, 2) or inside it, convex or not.

    A margin of 0 is the polygon itself; a vehicle's outline with a margin is a distance round its body.
    """

    polygon_m: Array
    margin_m: float = 0.0

    def signed_distance_m(self, points_m: Array) -> Array:
        """Distance of points (n, 2) from the zone's border [m], negative inside, (n,)."""
        distance_m = np.linalg.norm(points_m - nearest_on_border(self.polygon_m, points_m), axis=1)
        signed: Array = np.where(is_inside(self.polygon_m, points_m), -distance_m, distance_m) - self.margin_m
        return signed

    def placed(self, x_m: float, y_m: float, yaw_rad: float) -> "ZoneShape":
        """The zone of a body that stands at (x, y) [m] with `yaw_rad` (counter-clockwise) in the frame wanted."""
        cos, sin = math.cos(yaw_rad), math.sin(yaw_rad)
        turned = self.polygon_m @ np.array([[cos, sin], [-sin, cos]])
        return ZoneShape(turned + np.array([x_m, y_m]), self.margin_m)

    def widened(self, margin_m: float) -> "ZoneShape":
        """The same polygon with another margin [m]."""
        return ZoneShape(self.polygon_m, margin_m)


def outline(length_m: float, width_m: float) -> Array:
    """Corners (4, 2) of a body in its own frame: x forward, y left, origin in its middle."""
    return 0.5 * np.array(
        [[length_m, width_m], [-length_m, width_m], [-length_m, -width_m], [length_m, -width_m]], dtype=float
    )
