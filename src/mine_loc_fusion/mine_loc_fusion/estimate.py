"""What every estimator takes and answers."""

from dataclasses import dataclass
from enum import IntEnum
from math import inf
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from mine_loc_core.verdicts import Verdict

Array = npt.NDArray[np.float64]


class Mode(IntEnum):
    """Constants of mine_loc_interfaces/PersonPose: what an estimate rests on."""

    UNKNOWN = 0
    INITIALISING = 1
    UWB_PDR = 2
    UWB_ONLY = 3
    DEAD_RECKONING = 4
    COASTING = 5
    COARSE_ONLY = 6
    LOST = 7


@dataclass(frozen=True, slots=True)
class PositionFix:
    """A solved position: `position_m` (2,) in the map, `covariance_m2` (2, 2)."""

    position_m: Array
    covariance_m2: Array


@dataclass(frozen=True, slots=True)
class StepFix:
    """A step: its heading in the person's odom frame (ENU yaw), NaN interval = the first after standing."""

    length_m: float
    length_variance_m2: float
    heading_rad: float
    heading_variance_rad2: float
    interval_s: float


@dataclass(frozen=True, slots=True)
class EpochInputs:
    """The measurements of one epoch, in the order they are to be used."""

    stamp_ns: int
    positions: tuple[PositionFix, ...] = ()
    steps: tuple[StepFix, ...] = ()


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
    mode: Mode
    yaw_offset_rad: float | None = None
    since_uwb_s: float = inf
    since_step_s: float = inf


class Estimator(Protocol):
    """One person's filter. Stamps given to `update` do not go back; `save` and `restore` serve late inputs."""

    def update(self, inputs: EpochInputs) -> tuple[Verdict, ...]:
        """Predict to the epoch and use its measurements; one verdict a measurement, in order."""

    def estimate(self, stamp_ns: int) -> Estimate | None:
        """The state predicted to `stamp_ns` without changing it; None before the first position."""

    def save(self) -> Any:
        """The whole state, to be given to `restore`."""

    def restore(self, saved: Any) -> None:
        """Go back to a saved state."""
