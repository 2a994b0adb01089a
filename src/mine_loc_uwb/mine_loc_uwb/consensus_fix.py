"""A first position from one round, when nothing is known yet and any of the ranges may be too long.

Least squares is started all round every anchor, its weights are made one-sided by the residuals, and the minimum that
ranges agree with best is taken. Where another, distant minimum is nearly as good (anchors in a line have a mirror
image), the answer spans both: their middle, with the covariance of either.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

from mine_loc_uwb.fix import Array
from mine_loc_uwb.geometry import direction, inverse_information
from mine_loc_uwb.weighted_lm import weighted_lm

_DIRECTIONS, _NEAREST = 8, 4
_KNEE_SDS = 2.0
_REWEIGHTINGS = 6
_AS_GOOD = 6.0  # more deviance than this makes a minimum a worse explanation
_SAME_PLACE_SDS = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Consensus:
    """`position_m` (d,), `covariance_m2` (d, d); `agreeing` (n,) are the ranges that fit within three deviations."""

    position_m: Array
    covariance_m2: Array
    agreeing: npt.NDArray[np.bool_]
    ambiguous: bool


def consensus_fix(
    anchors_m: Array, range_m: Array, *, range_sd_m: float, nlos_scale_m: float, height_m: float | None
) -> Consensus | None:
    """Best position of n ranges to anchors (n, 3), n at least d; None where they do not determine one."""
    dimensions = 3 if height_m is None else 2
    if len(range_m) < dimensions:
        return None
    height = math.nan if height_m is None else height_m
    minima = [
        _descend(start, anchors_m, range_m, range_sd_m, nlos_scale_m, height)
        for start in _starts(anchors_m, range_m, dimensions)
    ]
    minima.sort(key=lambda minimum: minimum[0])
    least, position, residual, weights = minima[0]
    covariance = np.empty((dimensions, dimensions))
    if not inverse_information(position, anchors_m, weights, height, covariance):
        return None
    covariance *= range_sd_m**2
    agreeing = np.abs(residual) < 3.0 * range_sd_m
    reach_m = _SAME_PLACE_SDS * math.sqrt(np.trace(covariance)) + range_sd_m
    others = [
        other
        for deviance, other, *_ in minima
        if deviance - least < _AS_GOOD and np.linalg.norm(other - position) > reach_m
    ]
    # Ranges that disagree more than their noise allows have not been made right by the place they agree on best.
    covariance *= max(1.0, least / max(len(range_m) - dimensions, 1))
    if not others:
        return Consensus(position, covariance, agreeing, ambiguous=False)
    places = np.array([position, max(others, key=lambda other: float(np.linalg.norm(other - position)))])
    middle = places.mean(axis=0)
    spread = (places - middle).T @ (places - middle) / len(places)
    return Consensus(middle, covariance + spread, agreeing, ambiguous=True)


def _starts(anchors_m: Array, range_m: Array, dimensions: int) -> Array:
    """Points round the anchors of the shortest ranges, at those, (s, d)."""
    near = np.argsort(range_m, kind="stable")[:_NEAREST]
    angle = (np.arange(_DIRECTIONS) + 0.25) * (2.0 * np.pi / _DIRECTIONS)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    if dimensions == 3:
        ring = np.concatenate([np.column_stack([ring, np.full(len(ring), up)]) for up in (-0.7, 0.1, 0.7)])
    starts = anchors_m[near, None, :dimensions] + range_m[near, None, None] * ring
    return np.ascontiguousarray(starts.reshape(-1, dimensions))


@njit(cache=True)
def _descend(
    start: Array, anchors_m: Array, range_m: Array, sd_m: float, scale_m: float, height_m: float
) -> tuple[float, Array, Array, Array]:
    """Deviance, position (d,), residuals (n,) and weights (n,) where reweighted least squares ends."""
    position, unit, count = start, np.empty(len(start)), len(range_m)
    residual, weights, total = np.empty(count), np.ones(count), 0.0
    for _ in range(_REWEIGHTINGS):
        position = weighted_lm(position, anchors_m, range_m, weights, height_m)
        total = 0.0
        for number in range(count):
            residual[number] = range_m[number] - direction(position, anchors_m[number], height_m, unit)
            deviance, weights[number] = _law(residual[number], sd_m, scale_m)
            total += deviance
    return total, position, residual, weights


@njit(cache=True)
def _law(residual_m: float, sd_m: float, scale_m: float) -> tuple[float, float]:
    """Deviance and weight of a residual: squared, but linear where the range is too long by more than its noise.

    The weight falls faster than the deviance's slope would have it, which finds the minimum a little more often.
    """
    z, knee = residual_m / sd_m, max(_KNEE_SDS, sd_m / scale_m)
    deviance = z * z if z <= knee else knee * knee + 2.0 * (residual_m - knee * sd_m) / scale_m
    return deviance, 1.0 if z <= _KNEE_SDS else math.sqrt(deviance) / (z * z)
