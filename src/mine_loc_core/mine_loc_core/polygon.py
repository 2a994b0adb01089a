"""Points against polygons on the ground plan: which are inside, and what of the border is nearest."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def is_inside(polygon_m: Array, points_m: Array) -> npt.NDArray[np.bool_]:
    """Whether points (n, 2) are inside a polygon (k, 2), convex or not, by the even-odd rule, (n,)."""
    start, end = polygon_m, _next(polygon_m)
    edge = end - start
    x, y = points_m[:, :1], points_m[:, 1:]
    straddles = (start[:, 1] > y) != (end[:, 1] > y)
    # Not by where the edge meets the point's height: that divides by next to nothing where an edge is nearly level.
    left = ((x - start[:, 0]) * edge[:, 1] < (y - start[:, 1]) * edge[:, 0]) == (edge[:, 1] > 0.0)
    inside: npt.NDArray[np.bool_] = np.sum(straddles & left, axis=1) % 2 == 1
    return inside


def nearest_on_border(polygon_m: Array, points_m: Array) -> Array:
    """The point of the border of a polygon (k, 2) that is nearest to each of the points (n, 2), (n, 2)."""
    start, edge = polygon_m, _next(polygon_m) - polygon_m
    offset = points_m[:, None] - start
    share = np.clip(np.sum(offset * edge, axis=2) / np.maximum(np.sum(edge**2, axis=1), 1e-300), 0.0, 1.0)
    feet = start + share[..., None] * edge
    best = np.argmin(np.sum((feet - points_m[:, None]) ** 2, axis=2), axis=1)
    nearest: Array = feet[np.arange(len(points_m)), best]
    return nearest


def _next(polygon_m: Array) -> Array:
    """The corner after each, in a fifth of the time of np.roll."""
    return np.concatenate((polygon_m[1:], polygon_m[:1]))
