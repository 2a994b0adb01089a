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

from mine_loc_core.walkable_area import WalkableArea
from mine_loc_fusion.estimate import Array

_REACH_SD = 3.0
_LEAST_SHARE = 1e-4
"""Less of the Gaussian than this between the walls: it is the map, or the place, that is wrong."""
_IN_ROCK_M = 0.05
_NOTHING_M2 = 1e6
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
    sd_m = math.sqrt(max(float(np.linalg.eigvalsh(covariance[:2, :2])[-1]), 0.0))
    found = _only_leg(position_m, _REACH_SD * sd_m, area)
    if found is None:
        return position_m, velocity_ms, covariance
    across, half_m, off_m = found
    h = np.array([*across, 0.0, 0.0])
    Ph = covariance @ h
    variance_m2 = float(h @ Ph)
    shift, share = _truncated(math.sqrt(variance_m2), off_m, half_m)
    gain = Ph / variance_m2
    change = gain * shift
    kept_m2 = variance_m2 * share
    if doubted:
        kept_m2 = max(kept_m2, half_m**2 / 3.0)
    kept = covariance + np.outer(gain, gain) * (kept_m2 - variance_m2)
    return position_m + change[:2], velocity_ms + change[2:], kept


def _only_leg(position_m: Array, reach_m: float, area: WalkableArea) -> tuple[Array, float, float] | None:
    """Unit vector across, half width and offset from the centre line of the only leg within reach."""
    legs = area.legs
    offset = position_m - legs[:, :2]
    s = offset[:, 0] * legs[:, 2] + offset[:, 1] * legs[:, 3]
    t = offset[:, 1] * legs[:, 2] - offset[:, 0] * legs[:, 3]
    near = (s > legs[:, 4] - reach_m) & (s < legs[:, 5] + reach_m) & (np.abs(t) < legs[:, 6] + reach_m)
    if near.sum() != 1 or any(_within(position_m, polygon, reach_m) for polygon in area.polygons):
        return None
    leg = int(np.argmax(near))
    return np.array([-legs[leg, 3], legs[leg, 2]]), float(legs[leg, 6]), float(t[leg])


def _within(position_m: Array, polygon_m: Array, reach_m: float) -> bool:
    """Whether a chamber may be reached: by its bounding box, from above."""
    return bool(((position_m > polygon_m.min(axis=0) - reach_m) & (position_m < polygon_m.max(axis=0) + reach_m)).all())


def _truncated(sd_m: float, mean_m: float, half_m: float) -> tuple[float, float]:
    """Shift of the mean [m] and factor on the variance of a Gaussian cut off at ± `half_m`."""
    a, b = (-half_m - mean_m) / sd_m, (half_m - mean_m) / sd_m
    inside = 0.5 * (math.erf(b / math.sqrt(2.0)) - math.erf(a / math.sqrt(2.0)))
    if inside < _LEAST_SHARE:
        return 0.0, 1.0
    at_a, at_b = (math.exp(-0.5 * each * each) / math.sqrt(2.0 * math.pi) for each in (a, b))
    mean = (at_a - at_b) / inside
    return mean * sd_m, 1.0 + (a * at_a - b * at_b) / inside - mean * mean
