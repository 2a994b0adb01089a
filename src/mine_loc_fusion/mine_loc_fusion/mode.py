"""What an estimate rests on, as other software is told."""

from dataclasses import dataclass
from enum import IntEnum
from math import inf

from mine_loc_fusion.estimate import Estimate, ce95_m


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
class ModeLimits:
    """How long without positions or steps counts as their absence [s]; the 95 % circle beyond which a pose is lost."""

    uwb_timeout_s: float
    step_timeout_s: float
    lost_ce95_m: float


def mode_of(estimate: Estimate, limits: ModeLimits) -> Mode:
    """The mode of an estimate at its own instant."""
    if ce95_m(estimate.covariance[:2, :2]) > limits.lost_ce95_m:
        return Mode.LOST if estimate.since_region_s == inf else Mode.COARSE_ONLY
    stepping = estimate.yaw_offset_rad is not None and estimate.since_step_s < limits.step_timeout_s
    if estimate.since_uwb_s < limits.uwb_timeout_s:
        return Mode.UWB_PDR if stepping else Mode.UWB_ONLY
    if estimate.since_region_s < estimate.since_uwb_s:
        return Mode.COARSE_ONLY
    return Mode.DEAD_RECKONING if stepping else Mode.COASTING
