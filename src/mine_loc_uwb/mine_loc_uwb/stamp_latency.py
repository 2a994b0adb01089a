"""The constant by which a radio's stamps are late, from ranges whose truth is known.

A range stamped t was measured at t minus the latency. The latency is where the ranges agree best with the true
distances at those instants: least mean absolute residual, each anchor's median residual taken off, so that offsets and
outliers count for nothing. Only motion along the links shows it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_S

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

_STEP_S = 0.02
_BLOCKS = 5
_LEAST_RANGES = 50
_LEAST_RADIAL_SPEED_M_S = 0.05
_LEAST_STANDARD_ERROR_S = 0.002


@dataclass(frozen=True, slots=True)
class StampLatency:
    """Latency, its standard error over blocks of the run, and the mean absolute residual without and with it."""

    latency_s: float
    standard_error_s: float
    residual_before_m: float
    residual_after_m: float


@dataclass(frozen=True, slots=True, eq=False)
class TimedRanges:
    """Ranges (n,) with stamps [ns], the anchors' places (n, 3) and their numbers (n,), and the track of the truth."""

    stamp_ns: Integers
    range_m: Array
    anchor: Integers
    anchor_m: Array
    track_ns: Integers  # (t,), rising
    track_m: Array  # (t, 3)

    def only(self, which: npt.NDArray[np.bool_] | Integers) -> "TimedRanges":
        """Those ranges that `which` picks."""
        return replace(
            self,
            stamp_ns=self.stamp_ns[which],
            range_m=self.range_m[which],
            anchor=self.anchor[which],
            anchor_m=self.anchor_m[which],
        )

    def residual_m(self, latency_s: float) -> Array:
        """Range minus true distance at the instants that a latency gives, NaN where the track does not reach."""
        at_s = (self.stamp_ns - self.track_ns[0]) / NS_PER_S - latency_s
        track_s = (self.track_ns - self.track_ns[0]) / NS_PER_S
        place_m = [np.interp(at_s, track_s, axis_m, left=np.nan, right=np.nan) for axis_m in self.track_m.T]
        return np.asarray(self.range_m - np.linalg.norm(np.stack(place_m, axis=1) - self.anchor_m, axis=1))


def common_latency_s(found: Sequence[StampLatency]) -> float:
    """Weighted mean of several tags' or runs' latencies; 0 without any, or where it is within two standard errors."""
    if not found:
        return 0.0
    weight = np.array([max(each.standard_error_s, _LEAST_STANDARD_ERROR_S) ** -2 for each in found])
    mean_s = float(np.average([each.latency_s for each in found], weights=weight))
    return mean_s if abs(mean_s) > 2.0 / np.sqrt(weight.sum()) else 0.0


def fit_stamp_latency(ranges: TimedRanges, *, most_s: float = 0.5) -> StampLatency:
    """Search latencies from -`most_s` to `most_s`.

    Raises ConfigurationError when there are too few ranges within the track or the tag hardly moves along its links.
    """
    inside = (ranges.stamp_ns >= ranges.track_ns[0] + most_s * NS_PER_S) & np.isfinite(ranges.range_m)
    inside &= ranges.stamp_ns <= ranges.track_ns[-1] - most_s * NS_PER_S
    if inside.sum() < _LEAST_RANGES:
        raise ConfigurationError(f"ranges within the true track: {inside.sum()}; allowed: {_LEAST_RANGES} or more")
    ranges = ranges.only(inside)
    shift_m = ranges.residual_m(0.5 * _STEP_S) - ranges.residual_m(-0.5 * _STEP_S)
    speed_m_s = float(np.mean(np.abs(shift_m))) / _STEP_S
    if speed_m_s < _LEAST_RADIAL_SPEED_M_S:
        raise ConfigurationError(
            f"speed along the links: {speed_m_s:.3f} m/s; allowed: {_LEAST_RADIAL_SPEED_M_S} m/s or more, "
            "since ranges of a tag at rest say nothing of their stamps"
        )
    latency_s = _best(ranges, most_s)
    blocks = np.array_split(np.argsort(ranges.stamp_ns, kind="stable"), _BLOCKS)
    found = [_best(ranges.only(block), most_s) for block in blocks]
    error_s = float(np.std(found, ddof=1) / np.sqrt(_BLOCKS))
    return StampLatency(latency_s, error_s, _loss_m(ranges, 0.0), _loss_m(ranges, latency_s))


def _best(ranges: TimedRanges, most_s: float) -> float:
    grid_s = np.arange(-most_s, most_s + 0.5 * _STEP_S, _STEP_S)
    start_s = grid_s[int(np.argmin([_loss_m(ranges, float(each)) for each in grid_s]))]
    bounds = max(start_s - _STEP_S, -most_s), min(start_s + _STEP_S, most_s)
    return float(minimize_scalar(lambda at_s: _loss_m(ranges, float(at_s)), bounds=bounds, method="bounded").x)


def _loss_m(ranges: TimedRanges, latency_s: float) -> float:
    residual_m = ranges.residual_m(latency_s)
    for each in np.unique(ranges.anchor):
        residual_m[ranges.anchor == each] -= np.median(residual_m[ranges.anchor == each])
    return float(np.mean(np.abs(residual_m)))
