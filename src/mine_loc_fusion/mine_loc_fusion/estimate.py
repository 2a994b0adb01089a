"""What every estimator takes and answers."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import hypot, inf, isfinite, nan, sqrt
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from mine_loc_core.gates import chi2_quantile
from mine_loc_core.stamps import to_s
from mine_loc_core.verdicts import Source, Verdict
from mine_loc_uwb.measurements import Measurements

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PositionFix:
    """A solved position: `position_m` (2,) in the map, `covariance_m2` (2, 2).

    `los_probability` is the mean over the links it rests on, NaN = not judged.
    """

    position_m: Array
    covariance_m2: Array
    los_probability: float = nan


@dataclass(frozen=True, slots=True)
class StepFix:
    """A step: its heading in the person's odom frame (ENU yaw), NaN interval = the first after standing."""

    length_m: float
    length_variance_m2: float
    heading_rad: float
    heading_variance_rad2: float
    interval_s: float


@dataclass(frozen=True, slots=True)
class VelocityChange:
    """By how much the velocity changed in the `interval_s` before: `change_m_s` (3,) in the person's odom frame."""

    change_m_s: Array
    interval_s: float


@dataclass(frozen=True, slots=True)
class PlaceFix:
    """A place told by something else than ranges: a recognised turn, a coarse region, somebody who knows.

    Horizontal, `position_m` (2,) in the map with `covariance_m2` (2, 2); `source` is LANDMARK or REGION.
    """

    source: Source
    position_m: Array
    covariance_m2: Array


@dataclass(frozen=True, slots=True)
class EpochInputs:
    """The measurements of one epoch.

    `ranges` are rounds and blinks, `positions` what a solver made of them: an estimator uses the one or the other.
    """

    stamp_ns: int
    positions: tuple[PositionFix, ...] = ()
    steps: tuple[StepFix, ...] = ()
    ranges: tuple[Measurements, ...] = ()
    places: tuple[PlaceFix, ...] = ()
    velocity_changes: tuple[VelocityChange, ...] = ()


SOURCE_OF: Mapping[str, Callable[[Any], Source]] = {
    "positions": lambda _: Source.UWB_POSE,
    "steps": lambda _: Source.STEP,
    "ranges": lambda measurements: Source.TDOA if measurements.shared_offset else Source.RANGE,
    "places": lambda place: place.source,
    "velocity_changes": lambda _: Source.IMU,
}
"""The kind of each of an epoch's measurements, by the field that holds it."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """State of one person at `stamp_ns`: horizontal position (2,) [m], velocity (2,) [m/s], in the map (ENU).

    `covariance` (4, 4) is of (x, y, vx, vy). `yaw_offset_rad` is the yaw of the odom frame in the map, None while
    unknown. `since_*_s` are the times since the last accepted measurement of a kind, inf = never.
    """

    stamp_ns: int
    position_m: Array
    velocity_ms: Array
    covariance: Array
    yaw_offset_rad: float | None = None
    since_uwb_s: float = inf
    since_step_s: float = inf
    since_region_s: float = inf
    height_m: float | None = None
    """Where it is solved for."""


class Estimator(Protocol):
    """One person's filter. Stamps given to `update` do not go back; `save` and `restore` serve late inputs."""

    def begin(self, stamp_ns: int, position_m: Array, covariance_m2: Array, yaw: tuple[float, float] | None) -> None:
        """Start at a place (2,) in the map; `yaw` is that of the odom frame and its variance, None = unknown."""

    def update(self, inputs: EpochInputs) -> tuple[Verdict, ...]:
        """Predict to the epoch and use its measurements; one verdict a measurement."""

    def estimate(self, stamp_ns: int) -> Estimate | None:
        """The state predicted to `stamp_ns` without changing it; None before the first position."""

    def save(self) -> Any:
        """The whole state, to be given to `restore`."""

    def restore(self, saved: Any) -> None:
        """Go back to a saved state."""


_FARTHEST_M = 1e8  # beyond any map, grid coordinates included
_LARGEST_SD_M = 1e4  # a position that is no surer says nothing
_LONGEST_STEP_M = 5.0
_LONGEST_CHANGE_S = 1.0
_LARGEST_ACCELERATION_M_S2 = 100.0  # people do not survive more


def is_position(position_m: Array, covariance_m2: Array) -> bool:
    """Whether these are a place (2,) and a covariance (2, 2)."""
    finite = np.abs(position_m).max() < _FARTHEST_M and np.abs(covariance_m2).max() < _LARGEST_SD_M**2  # false for NaN
    return bool(finite and np.linalg.eigvalsh(covariance_m2 + covariance_m2.T)[0] > 0.0)


def symmetric(covariance: Array) -> Array:
    """The covariance without what its two halves disagree in."""
    mean: Array = (covariance + covariance.T) / 2.0
    return mean


def is_step(step: StepFix) -> bool:
    """Whether this is a step that a person can make, with variances."""
    possible = 0.0 <= step.length_m < _LONGEST_STEP_M and isfinite(step.heading_rad)
    return possible and 0.0 <= step.length_variance_m2 < _LARGEST_SD_M**2 and 0.0 <= step.heading_variance_rad2 < inf


def is_velocity_change(change: VelocityChange) -> bool:
    """Whether this is a change that can happen to a person, over a time in which directions hold."""
    most_m_s = _LARGEST_ACCELERATION_M_S2 * change.interval_s
    return 0.0 < change.interval_s <= _LONGEST_CHANGE_S and bool(np.abs(change.change_m_s).max() <= most_m_s)


def since_s(then_ns: int | None, now_ns: int) -> float:
    """Time gone since an instant, inf since None."""
    return inf if then_ns is None else to_s(max(0, now_ns - then_ns))


def ce95_m(covariance_m2: Array) -> float:
    """Radius of the circle round the mean that holds a Gaussian (2, 2) with probability 0.95, from above.

    Exact for a circular distribution; for a long one the quantile of its longer axis, which is never less.
    """
    (xx, xy), (_, yy) = covariance_m2.tolist()
    largest = 0.5 * (xx + yy) + hypot(0.5 * (xx - yy), xy)
    return sqrt(max(largest, 0.0) * chi2_quantile(0.95, 2))
