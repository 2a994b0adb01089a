"""What walls say of an estimate: a person in a gallery is between its walls.

Inside, the Gaussian across the gallery is cut off at the walls and replaced by the one of the same mean and variance
(density truncation: Simon, "Kalman filtering with state constraints", IET Control Theory and Applications 4, 2010). It
is done to what is put out, never fed back, because walls seen again are no new evidence.

An estimate in the rock is another matter: there the walls contradict what led to it. In a gallery, anchors stand nearly
in line, and ranges that are too long on both sides of a person are explained by a place far out across it as well as by
their biases. The walls say which; so they are fed back, and the biases take up what is left.
"""

import math

import numpy as np
from numba import njit

from mine_loc_core.walkable_area import WalkableArea
from mine_loc_fusion.estimate import Array

_REACH_SD = 3.0
_LEAST_SHARE = 1e-4
"""Less of the Gaussian than this between the walls: it is the map, or the place, that is wrong."""
_IN_ROCK_M = 0.05
_NOTHING_M2 = 1e6
_SQRT_2PI = math.sqrt(2.0 * math.pi)
_HALF_WIDTH_M = 2.0
"""Of a common gallery: how far inside its wall the middle is."""


def inside(position_m: Array, area: WalkableArea) -> tuple[Array, Array] | None:
    """Where a person is whom ranges place in the rock: anywhere across the nearest gallery, along it as found.

    Position (2,) and covariance (2, 2), of which the part along the gallery says nothing; None where `position_m` (2,)
    is no rock.
    """
    if area.holds(position_m):
        return None
    wall_m = area.nearest(position_m[None])[0]
    out_m = position_m - wall_m
    depth_m = float(np.hypot(*out_m))
    if depth_m < _IN_ROCK_M:
        return None
    out = out_m / depth_m
    across = np.outer(out, out)
    return wall_m - _HALF_WIDTH_M * out, _HALF_WIDTH_M**2 / 3.0 * across + _NOTHING_M2 * (np.eye(2) - across)


def between_walls(
    position_m: Array, velocity_ms: Array, covariance: Array, area: WalkableArea, *, doubted: bool = False
) -> tuple[Array, ...]:
    """Position (2,), velocity (2,) and their covariance (4, 4) with the walls of the one gallery in reach.

    `doubted`: ranges placed the person in the rock lately, so across the gallery nothing better is claimed than to be
    in it. Unchanged where several galleries or a chamber are within three standard deviations.
    """
    least = 1.0 / 3.0 if doubted else 0.0  # of a place anywhere in the gallery
    return _cut_off(position_m, velocity_ms, covariance, area.legs, area.chamber_boxes, least)


@njit(cache=True)
def _cut_off(
    position_m: Array, velocity_ms: Array, covariance: Array, legs: Array, boxes: Array, least: float
) -> tuple[Array, Array, Array]:
    half_trace, off = 0.5 * (covariance[0, 0] + covariance[1, 1]), covariance[0, 1]
    largest = half_trace + math.sqrt((0.5 * (covariance[0, 0] - covariance[1, 1])) ** 2 + off * off)
    leg = _only_leg(position_m, _REACH_SD * math.sqrt(max(largest, 0.0)), legs, boxes)
    if leg < 0:
        return position_m, velocity_ms, covariance
    x, y, half_m = -legs[leg, 3], legs[leg, 2], legs[leg, 6]
    off_m = (position_m[0] - legs[leg, 0]) * x + (position_m[1] - legs[leg, 1]) * y
    Ph = covariance[:, 0] * x + covariance[:, 1] * y
    variance_m2 = x * Ph[0] + y * Ph[1]
    shift_m, share = _truncated(math.sqrt(variance_m2), off_m, half_m)
    gain = Ph / variance_m2
    kept_m2 = max(variance_m2 * share, least * half_m**2)
    kept = covariance + np.outer(gain, gain) * (kept_m2 - variance_m2)
    return position_m + gain[:2] * shift_m, velocity_ms + gain[2:] * shift_m, kept


@njit(cache=True)
def _only_leg(position_m: Array, reach_m: float, legs: Array, boxes: Array) -> int:
    """Number of the only leg within reach; -1 where there is none, or another, or a chamber by its bounding box."""
    x, y = position_m
    for box in boxes:
        if box[0] - reach_m < x < box[2] + reach_m and box[1] - reach_m < y < box[3] + reach_m:
            return -1
    found = -1
    for number, leg in enumerate(legs):
        s = (x - leg[0]) * leg[2] + (y - leg[1]) * leg[3]
        t = (y - leg[1]) * leg[2] - (x - leg[0]) * leg[3]
        if leg[4] - reach_m < s < leg[5] + reach_m and abs(t) < leg[6] + reach_m:
            if found >= 0:
                return -1
            found = number
    return found


@njit(cache=True)
def _truncated(sd_m: float, mean_m: float, half_m: float) -> tuple[float, float]:
    """Shift of the mean [m] and factor on the variance of a Gaussian cut off at ± `half_m`."""
    a, b = (-half_m - mean_m) / sd_m, (half_m - mean_m) / sd_m
    inside = 0.5 * (math.erf(b / math.sqrt(2.0)) - math.erf(a / math.sqrt(2.0)))
    if inside < _LEAST_SHARE:
        return 0.0, 1.0
    at_a, at_b = math.exp(-0.5 * a * a) / _SQRT_2PI, math.exp(-0.5 * b * b) / _SQRT_2PI
    mean = (at_a - at_b) / inside
    return mean * sd_m, 1.0 + (a * at_a - b * at_b) / inside - mean * mean
