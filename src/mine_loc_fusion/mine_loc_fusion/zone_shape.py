"""The ground plan of a zone: a polygon and everything within a distance of it."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

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
        return _from_polygon_m(self.polygon_m, points_m) - self.margin_m

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


def _from_polygon_m(polygon_m: Array, points_m: Array) -> Array:
    """Signed distance (n,) from the polygon's border; inside by the even-odd rule."""
    start, end = polygon_m, np.roll(polygon_m, -1, axis=0)
    edge = end - start
    offset = points_m[:, None] - start
    length_sq = np.maximum(np.sum(edge**2, axis=1), 1e-300)
    share = np.clip(np.sum(offset * edge, axis=2) / length_sq, 0.0, 1.0)
    distance_m = np.sqrt(np.min(np.sum((offset - share[..., None] * edge) ** 2, axis=2), axis=1))
    x, y = points_m[:, :1], points_m[:, 1:]
    rise = end[:, 1] > start[:, 1]
    straddles = (start[:, 1] > y) != (end[:, 1] > y)
    left = ((x - start[:, 0]) * edge[:, 1] < (y - start[:, 1]) * edge[:, 0]) == rise
    inside = np.sum(straddles & left, axis=1) % 2 == 1
    signed: Array = np.where(inside, -distance_m, distance_m)
    return signed
