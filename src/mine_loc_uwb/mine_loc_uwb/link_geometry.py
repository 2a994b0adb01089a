"""What the places of nodes make of the noise of their links: ranges, or arrivals that share an unknown offset."""

import numpy as np

from mine_loc_uwb.fix import Array


def weights(variance_m2: Array, *, shared_offset: bool) -> Array:
    """Inverse covariance (n, n) of measurements with these variances (n,), an offset of all left out when shared.

    The limit of (diag v + k 1 1ᵀ)⁻¹ for k → ∞: time differences to any one of them, weighted with their correlation.
    """
    precision = 1.0 / variance_m2
    return np.diag(precision) - (np.outer(precision, precision) / precision.sum() if shared_offset else 0.0)


def gdop(anchors_m: Array, position_m: Array, dimensions: int, *, shared_offset: bool) -> float:
    """Position error of links with errors of 1, in the first `dimensions`; infinite where they do not determine it.

    `anchors_m` has shape (n, 3), `position_m` (3,).
    """
    offset = position_m - anchors_m
    toward = (offset / np.maximum(np.linalg.norm(offset, axis=1), 1e-9)[:, None])[:, :dimensions]
    if len(toward) < dimensions + shared_offset:
        return np.inf
    information = toward.T @ weights(np.ones(len(toward)), shared_offset=shared_offset) @ toward
    if np.linalg.cond(information) > 1.0 / np.finfo(float).eps:
        return np.inf
    return float(np.sqrt(np.trace(np.linalg.inv(information))))


def left_out(innovation: Array, covariance: Array) -> Array:
    """How far each of n innovations (n,) is off what the others say, as a normal score (n,), their covariance (n, n).

    (S⁻¹ν)_i / sqrt((S⁻¹)_ii): its square is what χ² loses when the measurement is left out.
    """
    inverse = np.linalg.inv(covariance)
    return np.asarray(inverse @ innovation / np.sqrt(np.maximum(np.diag(inverse), np.finfo(float).tiny)))
