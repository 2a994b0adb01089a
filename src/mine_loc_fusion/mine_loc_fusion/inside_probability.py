"""How probable it is that a person is inside a zone: from mean and covariance, not from the mean alone."""

import math

import numpy as np

from mine_loc_fusion.zone_shape import Array, ZoneShape

_POINTS = 1024


def _spiral() -> Array:
    """Points (n, 2) that stand for equal shares of a standard normal distribution.

    Radii are its quantiles, angles go on by the golden angle (Vogel's spiral), so that no straight border lies along
    the points: the share inside a half plane is right to 0.008 whatever its direction.
    """
    number = np.arange(_POINTS) + 0.5
    radius = np.sqrt(-2.0 * np.log1p(-number / _POINTS))
    angle = number * math.pi * (3.0 - math.sqrt(5.0))
    points: Array = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return points


_STANDARD = _spiral()
_FARTHEST = float(np.max(np.linalg.norm(_STANDARD, axis=1)))


def inside_probability(shape: ZoneShape, mean_m: Array, covariance_m2: Array) -> float:
    """Probability [0..1] that a position of normal distribution lies in the zone.

    `mean_m` (2,), `covariance_m2` (2, 2) symmetric, in the zone's frame; eigenvalues below 0 (rounding) count as 0.
    What is within 1 in 1000 of 0 or 1 is that. Raises ValueError for what is not finite.
    """
    if not (np.isfinite(mean_m).all() and np.isfinite(covariance_m2).all()):
        raise ValueError("mean and covariance must be finite")
    variances, axes = np.linalg.eigh(covariance_m2)
    spread = np.sqrt(np.maximum(variances, 0.0))
    distance_m = float(shape.signed_distance_m(mean_m[None])[0])
    if abs(distance_m) > _FARTHEST * spread[-1]:
        return float(distance_m < 0.0)
    points = mean_m + _STANDARD * spread @ axes.T
    return float(np.mean(shape.signed_distance_m(points) <= 0.0))
