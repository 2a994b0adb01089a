"""Position and velocity of emitters by all their bearings of the window, each at its own instant.

So a report that comes late corrects the emitter's place by its motion, and needs no special treatment. Gauss-Newton on
the angles themselves, for all emitters at once; the prior is that of a walker who may be anywhere.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mine_loc_coarse.open_reports import Reports

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_ITERATIONS = 4
_LEAST_DISTANCE_M = 10.0
"""Nearer than this the direction from a monitor says nothing of a place."""
_LONGEST_STEP_M = 1000.0
"""Nearly collinear bearings are not linear over more: unbounded steps run away along them."""
_UPPER = np.triu_indices(4)


@dataclass(frozen=True, slots=True)
class Bearings:
    """n bearings: emitter (n,), monitor (n,), its place (n, 2) [m], seconds before now (n,), yaw [rad]."""

    emitter: Indices
    monitor: Indices
    place_m: Array
    age_s: Array
    azimuth_rad: Array


@dataclass(frozen=True, slots=True)
class Fits:
    """k emitters now: state (k, 4) x, y, vx, vy [m, m/s], covariance (k, 4, 4), and the fit of each bearing.

    `residual_rad` (n,) is the reported yaw minus that of the fit, `jacobian` (n, 4) what the yaw changes with the
    state.
    """

    state: Array
    covariance: Array
    residual_rad: Array
    jacobian: Array


def bearings_of(reports: Reports, report: Indices, emitter: Indices, place_m: Array, now_ns: int) -> Bearings:
    """Reports `report` (n,) of emitters `emitter` (n,) as bearings at `now_ns`; `place_m` (m, 2) are the monitors."""
    monitor = reports.monitor[report]
    age_s = np.asarray((now_ns - reports.stamp_ns[report]) * 1e-9, np.float64)
    return Bearings(emitter, monitor, place_m[monitor], age_s, reports.azimuth_rad[report])


def fit(bearings: Bearings, start_m: Array, sd_rad: float, position_sd_m: float, speed_sd_m_s: float) -> Fits:
    """Fit the emitters that `start_m` (k, 2) is near to.

    The prior has `position_sd_m` about the start, which only holds a nearly collinear emitter, and `speed_sd_m_s` an
    axis about rest.
    """
    k = len(start_m)
    prior = np.diag([position_sd_m**-2, position_sd_m**-2, speed_sd_m_s**-2, speed_sd_m_s**-2])
    mean = np.hstack([start_m, np.zeros((k, 2))])
    state = mean.copy()
    information = np.empty((k, 4, 4))
    for _ in range(_ITERATIONS):
        residual, jacobian = _linearised(bearings, state)
        scaled = jacobian / sd_rad**2
        for row, column in zip(*_UPPER, strict=True):
            summed = np.bincount(bearings.emitter, scaled[:, row] * jacobian[:, column], k) + prior[row, column]
            information[:, row, column] = information[:, column, row] = summed
        gradient = np.stack([np.bincount(bearings.emitter, scaled[:, c] * residual, k) for c in range(4)], axis=1)
        gradient += (mean - state) @ prior
        covariance = np.asarray(np.linalg.inv(information), np.float64)
        step = (covariance @ gradient[:, :, None])[:, :, 0]
        length_m = np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-9)
        state = state + step * np.minimum(1.0, _LONGEST_STEP_M / length_m)[:, None]
    residual, jacobian = _linearised(bearings, state)
    return Fits(np.asarray(state, np.float64), covariance, residual, jacobian)


def _linearised(bearings: Bearings, state: Array) -> tuple[Array, Array]:
    """Residuals (n,) and the derivatives (n, 4) of the yaws; a bearing of age t sees the emitter at p − t v."""
    own = state[bearings.emitter]
    x = own[:, 0] - bearings.age_s * own[:, 2] - bearings.place_m[:, 0]
    y = own[:, 1] - bearings.age_s * own[:, 3] - bearings.place_m[:, 1]
    squared = np.maximum(x * x + y * y, _LEAST_DISTANCE_M**2)
    residual = bearings.azimuth_rad - np.arctan2(y, x)
    residual -= 2.0 * np.pi * np.round(residual / (2.0 * np.pi))
    jacobian = np.empty((len(x), 4))
    jacobian[:, 0], jacobian[:, 1] = -y / squared, x / squared
    jacobian[:, 2:] = jacobian[:, :2] * -bearings.age_s[:, None]
    return residual, jacobian
