"""Likelihood of arrivals that are on time or late, hardly ever early: a normal core with a one-sided exponential tail.

The error of an arrival is N(0, s²), with probability w plus an exponential delay of mean τ: a mixture of a normal and
an exponentially modified normal, over a floor for values that come from no path at all. The weaker a signal that rises
slowly, the later its leading edge passes the threshold, so τ may grow as the level falls. An unknown offset that the
arrivals of a blink share is integrated out, so that the likelihood is of their differences with all their dependence.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.special import erfcx

from mine_loc_uwb.fix import Array

_FLOOR_SPAN_M = 100.0
_FALLING_FROM_DBM = -92.0
_LEAST_DELAY_SDS = 0.05
"""Shorter delays than this share of the core are not seen."""
_TABLE_SIZE, _TABLE_STEP_SDS, _TABLE_EARLY_SDS = 1024, 0.25, 8.0
_STEPS_PER_SD = 1.25
_MEAN_DELAYS, _REACH_DELAYS, _CORE_SDS = 7.0, 12.0, 4.0
"""How far before the earliest arrival, before the next one, and after it the offset is sought."""


@dataclass(frozen=True, slots=True)
class LateArrival:
    """The law's parameters; the core's variance comes with each measurement."""

    late_probability: float = 0.3
    delay_m: float = 1.0
    """Mean τ of the exponential delay, at -92 dBm."""
    growth_per_db: float = 0.0
    """By how much ln τ grows as the level falls by 1 dB."""
    most_delay_m: float = 10.0
    floor_probability: float = 1e-2
    """Of values from no path, above 0."""

    def delays_m(self, level_dbm: Array) -> Array:
        """τ by level (n,), NaN = not reported."""
        below_db = np.nan_to_num(_FALLING_FROM_DBM - level_dbm)
        return np.minimum(self.delay_m * np.exp(self.growth_per_db * below_db), self.most_delay_m)

    def moments(self, level_dbm: Array) -> tuple[Array, Array]:
        """Mean delay [m] and what delays add to the core's variance [m²] by level, (n,) each."""
        w, delay_m = self.late_probability, self.delays_m(level_dbm)
        return w * delay_m, w * (2.0 - w) * delay_m**2

    def log_density(self, error_m: Array, sd_m: Array, delay_m: Array) -> Array:
        """Logarithm of the density [1/m] of errors for cores and delays of these sizes; shapes broadcast."""
        delay_m = np.maximum(delay_m, _LEAST_DELAY_SDS * sd_m)
        z, w = error_m / sd_m, self.late_probability
        normal = np.exp(-0.5 * z**2)
        # exp(..) erfc(..) overflows apart: erfcx(x) = exp(x²) erfc(x) holds them together.
        x = (sd_m / delay_m - z) / np.sqrt(2.0)
        turned = normal * erfcx(np.abs(x))
        tail = 2.0 * np.exp(np.minimum(0.5 * (sd_m / delay_m) ** 2 - error_m / delay_m, 0.0))
        late = np.where(x >= 0.0, turned, tail - turned) * (0.5 / delay_m)
        mixed = (1.0 - w) * normal / (np.sqrt(2.0 * np.pi) * sd_m) + w * late
        return np.asarray(np.log((1.0 - self.floor_probability) * mixed + self.floor_probability / _FLOOR_SPAN_M))

    def log_likelihood(self, late_m: Array, sd_m: Array, delay_m: Array, *, shared_offset: bool) -> Array:
        """Logarithm of the likelihood (k,) of k hypotheses.

        `late_m` (k, n) is measured minus supposed, in which an unknown offset may still be; `sd_m` and `delay_m` (n,).
        """
        if not shared_offset or not late_m.shape[1]:
            return np.asarray(self.log_density(late_m, sd_m, delay_m).sum(axis=1))
        step_m = _TABLE_STEP_SDS * float(sd_m.min())
        start_m = -_TABLE_EARLY_SDS * float(sd_m.max())
        grid_m = np.linspace(start_m, start_m + step_m * (_TABLE_SIZE - 1), _TABLE_SIZE)
        table = self.log_density(grid_m, sd_m[:, None], delay_m[:, None])
        core_m, most_m = _CORE_SDS * float(sd_m.max()), float(delay_m.max())
        before_m = core_m + _MEAN_DELAYS * most_m / len(sd_m)
        window = before_m, core_m, _REACH_DELAYS * most_m, float(sd_m.min()) / _STEPS_PER_SD
        return _without_offset(np.ascontiguousarray(late_m), table, start_m, step_m, window)


@njit(cache=True)
def _without_offset(
    late_m: Array, table: Array, start_m: float, step_m: float, window: tuple[float, float, float, float]
) -> Array:
    """Integrate the offset out of the product of densities, which stand in a table (n, m)."""
    before_m, after_m, reach_m, stride_m = window
    count, size = late_m.shape[1], table.shape[1]
    result = np.empty(len(late_m))
    for k in range(len(late_m)):
        first = second = np.inf
        for i in range(count):
            if late_m[k, i] < first:
                first, second = late_m[k, i], first
            elif late_m[k, i] < second:
                second = late_m[k, i]
        second = second if count > 1 else first
        low = max(first - before_m, second - reach_m - before_m)
        total, scale = 0.0, -np.inf
        for step in range(int((second + after_m - low) / stride_m) + 1):
            value = 0.0
            for i in range(count):
                place = max((late_m[k, i] - low - step * stride_m - start_m) / step_m, 0.0)
                cell = min(int(place), size - 2)
                share = min(place - cell, 1.0)
                value += (1.0 - share) * table[i, cell] + share * table[i, cell + 1]
            if value > scale:
                total, scale = total * np.exp(scale - value) + 1.0, value
            else:
                total += np.exp(value - scale)
        result[k] = scale + np.log(total * stride_m)
    return result
