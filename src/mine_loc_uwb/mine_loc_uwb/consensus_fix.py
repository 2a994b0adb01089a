"""A first position from one round, when nothing is known yet and any of the ranges may be too long.

Least squares is started all round every anchor, its weights are made one-sided by the residuals, and the minimum that
ranges agree with best is taken. Where another, distant minimum is nearly as good (anchors in a line have a mirror
image), the answer spans both: their middle, with the covariance of either.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mine_loc_uwb.fix import Array
from mine_loc_uwb.geometry import inverse_information
from mine_loc_uwb.weighted_lm import weighted_lm

_DIRECTIONS = 8
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
    minima = []
    for start in _starts(anchors_m, range_m, dimensions):
        position = start
        weights = np.ones(len(range_m))
        for _ in range(_REWEIGHTINGS):
            position = weighted_lm(position, anchors_m, range_m, weights, height)
            residual = _residual(position, anchors_m, range_m, height_m)
            weights = _weights(residual, range_sd_m, nlos_scale_m)
        minima.append((float(_deviance(residual, range_sd_m, nlos_scale_m).sum()), position, residual, weights))
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
    """Points round each anchor at its range, (s, d)."""
    angle = (np.arange(_DIRECTIONS) + 0.25) * (2.0 * np.pi / _DIRECTIONS)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    if dimensions == 3:
        ring = np.concatenate([np.column_stack([ring, np.full(len(ring), up)]) for up in (-0.7, 0.1, 0.7)])
    return np.asarray((anchors_m[:, None, :dimensions] + range_m[:, None, None] * ring).reshape(-1, dimensions))


def _residual(position: Array, anchors_m: Array, range_m: Array, height_m: float | None) -> Array:
    place = position if height_m is None else np.append(position, height_m)
    return np.asarray(range_m - np.linalg.norm(anchors_m - place, axis=1))


def _deviance(residual: Array, sd_m: float, scale_m: float) -> Array:
    """Twice the negative logarithm of the one-sided law, but for a constant: linear where the range is too long."""
    z = residual / sd_m
    knee = max(2.0, sd_m / scale_m)
    return np.where(z > knee, knee**2 + 2.0 * (residual - knee * sd_m) / scale_m, z**2)


def _weights(residual: Array, sd_m: float, scale_m: float) -> Array:
    """Weights that make least squares descend that deviance."""
    z = np.abs(residual) / sd_m
    return np.where(residual > 2.0 * sd_m, np.sqrt(_deviance(residual, sd_m, scale_m)) / np.maximum(z, 1.0) ** 2, 1.0)
