"""Weighted Levenberg–Marquardt inside a Kalman filter of constant velocity (paper C).

The filter predicts the position; ranges weigh the less the more they differ from the distances to it; damped weighted
least squares from there gives a fix; the fix is what the filter measures. With the paper's diagonal R the axes of the
filter are independent: its state is, an axis, position, velocity and their three covariances.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from mine_loc_core.stamps import NS_PER_S
from mine_loc_core.verdicts import Reason
from mine_loc_uwb.fix import Array, Fix, FixStatus
from mine_loc_uwb.geometry import direction, gdop, inverse_information, solve_symmetric
from mine_loc_uwb.least_squares import LeastSquares
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.solver import Solution

_MOST_ITERATIONS = 20
_SETTLED_M = 1e-4
_FIRST_DAMPING = 1e-3
_POSITION, _VELOCITY, _PP, _PV, _VV = range(5)


@dataclass(frozen=True, slots=True)
class WeightedLmSettings:
    """Noise of the filter in physical units; the paper prints none of its Q, R and λ."""

    acceleration_density_m2_s3: float = 0.5
    """Spectral density of white acceleration."""
    difference_floor_m: float = 0.05
    """Ranges that differ less than this from the prediction weigh alike."""
    restart_after_s: float = 10.0
    """After such a silence the filter begins anew."""
    max_gdop: float = 10.0


@njit(cache=True)
def weighted_lm(start_m: Array, anchors_m: Array, range_m: Array, weights: Array, height_m: float) -> Array:
    """Position (d,) of least weighted squared range residual, from `start_m` (d,): ΔD = (JᵀWJ + λI)⁻¹ JᵀWξ.

    `anchors_m` is (n, 3), `range_m` and `weights` (n,). With d = 2 the tag is at `height_m`. λ falls when a step
    succeeds and rises when it does not, so the residual never grows.
    """
    position, trial = start_m.copy(), np.empty(len(start_m))
    normal, step = np.empty((len(start_m), len(start_m))), np.empty(len(start_m))
    cost, damping = _cost(position, anchors_m, range_m, weights, height_m), _FIRST_DAMPING
    for _ in range(_MOST_ITERATIONS):
        _normal_equations(position, anchors_m, range_m, weights, height_m, normal, step)
        for axis in range(len(position)):
            normal[axis, axis] += damping
        solve_symmetric(normal, step)
        moved = 0.0
        for axis in range(len(position)):
            trial[axis] = position[axis] + step[axis]
            moved += step[axis] * step[axis]
        trial_cost = _cost(trial, anchors_m, range_m, weights, height_m)
        if trial_cost <= cost:
            position[:] = trial
            cost, damping = trial_cost, damping * 0.1
            if moved < _SETTLED_M * _SETTLED_M:
                break
        else:
            damping *= 10.0
    return position


@njit(cache=True)
def _cost(position: Array, anchors_m: Array, range_m: Array, weights: Array, height_m: float) -> float:
    unit, cost = np.empty(len(position)), 0.0
    for number in range(len(range_m)):
        residual = range_m[number] - direction(position, anchors_m[number], height_m, unit)
        cost += weights[number] * residual * residual
    return cost


@njit(cache=True)
def _normal_equations(
    position: Array, anchors_m: Array, range_m: Array, weights: Array, height_m: float, normal: Array, gradient: Array
) -> None:
    """JᵀWJ into `normal` (d, d) and JᵀWξ into `gradient` (d,)."""
    unit = np.empty(len(position))
    normal[:], gradient[:] = 0.0, 0.0
    for number in range(len(range_m)):
        residual = range_m[number] - direction(position, anchors_m[number], height_m, unit)
        for i in range(len(position)):
            gradient[i] += weights[number] * residual * unit[i]
            for j in range(len(position)):
                normal[i, j] += weights[number] * unit[i] * unit[j]


@njit(cache=True)
def predict(state: Array, gone_s: float, acceleration_density_m2_s3: float) -> None:
    """Constant velocity under white acceleration; `state` is (d, 5): position, velocity, and P as pp, pv, vv."""
    q = acceleration_density_m2_s3 * gone_s
    for axis in state:
        axis[_POSITION] += gone_s * axis[_VELOCITY]
        axis[_PP] += gone_s * (2.0 * axis[_PV] + gone_s * axis[_VV]) + q * gone_s * gone_s / 3.0
        axis[_PV] += gone_s * axis[_VV] + q * gone_s / 2.0
        axis[_VV] += q


@njit(cache=True)
def update(state: Array, anchors_m: Array, range_m: Array, variance_m2: float, height_m: float, floor_m: float) -> bool:
    """Weigh the ranges against the predicted `state`, solve, and take the fix as the filter's measurement.

    Paper C: Δr_i = predicted − measured distance, weights the normalised inverse differences (the print has lost its
    eq. 7), R the fix's variance an axis. False, without an update, where the anchors do not determine a fix.
    """
    predicted, unit, weights = state[:, _POSITION].copy(), np.empty(len(state)), np.empty(len(range_m))
    total = 0.0
    for number in range(len(range_m)):
        difference = direction(predicted, anchors_m[number], height_m, unit) - range_m[number]
        weights[number] = 1.0 / (abs(difference) + floor_m)
        total += weights[number]
    for number in range(len(range_m)):
        weights[number] *= len(range_m) / total
    fix = weighted_lm(predicted, anchors_m, range_m, weights, height_m)
    covariance = np.empty((len(state), len(state)))
    if not inverse_information(fix, anchors_m, weights, height_m, covariance):
        return False
    for axis in range(len(state)):
        row = state[axis]
        innovation = row[_PP] + variance_m2 * covariance[axis, axis]
        gain_p, gain_v = row[_PP] / innovation, row[_PV] / innovation
        difference = fix[axis] - row[_POSITION]
        row[_POSITION] += gain_p * difference
        row[_VELOCITY] += gain_v * difference
        row[_VV] -= gain_v * row[_PV]
        row[_PV] *= 1.0 - gain_p
        row[_PP] *= 1.0 - gain_p
    return True


@njit(cache=True)
def advance(
    state: Array,
    gone_s: float,
    anchors_m: Array,
    range_m: Array,
    variance_m2: float,
    height_m: float,
    acceleration_density_m2_s3: float,
    floor_m: float,
) -> bool:
    """One fix of a running filter: `predict`, then `update`."""
    predict(state, gone_s, acceleration_density_m2_s3)
    return update(state, anchors_m, range_m, variance_m2, height_m, floor_m)


class WeightedLmFilter:
    """Tracks one tag; see `Solver`. The first two fixes are plain least squares and give the first velocity."""

    def __init__(self, settings: WeightedLmSettings | None = None) -> None:
        self._settings = settings or WeightedLmSettings()
        self._first: Fix | None = None
        self._state: Array | None = None
        self._stamp_ns = 0

    def solve(self, measurements: Measurements) -> Solution:
        """See `Solver`."""
        gone_s = (measurements.stamp_ns - self._stamp_ns) / NS_PER_S
        if gone_s > self._settings.restart_after_s:
            self._first = self._state = None
        if self._state is None:
            return self._begin(measurements, gone_s)
        predict(self._state, gone_s, self._settings.acceleration_density_m2_s3)
        self._stamp_ns = measurements.stamp_ns
        used = self._update(measurements, self._state)
        reason = Reason.ACCEPTED if used else Reason.DEGENERATE
        return _solution(self._fix(measurements, used=used), reason, len(measurements))

    def _update(self, measurements: Measurements, state: Array) -> bool:
        """A fix from too few ranges, or from anchors that hardly determine one, is not taken; the prediction stands."""
        if len(measurements) < len(state):
            return False
        height_m = measurements.plane_m
        ones = np.ones(len(measurements))
        if gdop(state[:, _POSITION].copy(), measurements.anchors_m, ones, height_m) > self._settings.max_gdop:
            return False
        variance = float(np.mean(measurements.variance_m2))
        return update(
            state, measurements.anchors_m, measurements.range_m, variance, height_m, self._settings.difference_floor_m
        )

    def _begin(self, measurements: Measurements, gone_s: float) -> Solution:
        solution = LeastSquares(self._settings.max_gdop).solve(measurements)
        if solution.fix.status is not FixStatus.OK:
            return solution
        if self._first is not None and gone_s > 0.0:
            self._state = _first_state(self._first, solution.fix, gone_s)
        self._first, self._stamp_ns = solution.fix, measurements.stamp_ns
        return solution

    def _fix(self, measurements: Measurements, *, used: bool) -> Fix:
        assert self._state is not None
        position, covariance = np.zeros(3), np.zeros((3, 3))
        axes = range(len(self._state))
        position[axes] = self._state[:, _POSITION]
        covariance[axes, axes] = self._state[:, _PP]
        if measurements.height_m is not None:
            position[2] = measurements.height_m
        residual = measurements.range_m - np.linalg.norm(measurements.anchors_m - position, axis=1)
        rms = math.sqrt(np.mean(residual**2)) if used else math.nan
        ones = np.ones(len(measurements))
        dilution = gdop(position[: len(self._state)], measurements.anchors_m, ones, measurements.plane_m)
        return Fix(FixStatus.OK, position, covariance, len(axes), len(residual) if used else 0, rms, dilution)


def _first_state(first: Fix, second: Fix, gone_s: float) -> Array:
    """Position of the second fix and the velocity between the two."""
    d = second.dimensions
    before, now = np.diag(first.covariance_m2)[:d], np.diag(second.covariance_m2)[:d]
    velocity = (second.position_m - first.position_m)[:d] / gone_s
    return np.column_stack([second.position_m[:d], velocity, now, now / gone_s, (before + now) / gone_s**2])


def _solution(fix: Fix, reason: Reason, count: int) -> Solution:
    return Solution(fix, (reason,) * count, np.full(count, math.nan), math.nan)
