"""What every position solver answers."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class FixStatus(IntEnum):
    """Constants of mine_loc_interfaces/UwbPose."""

    UNKNOWN = 0
    OK = 1
    TOO_FEW_RANGES = 2
    DEGENERATE = 3
    DIVERGED = 4


@dataclass(frozen=True, slots=True)
class Fix:
    """A position from one ranging round, in the frame of the anchors.

    `position_m` has shape (3,) and is NaN unless `status` is OK; `covariance_m2` has shape (3, 3); `gdop` is what
    the geometry makes of a range's standard deviation at best, in the solved dimensions, infinite when degenerate.
    """

    status: FixStatus
    position_m: Array
    covariance_m2: Array
    dimensions: int
    ranges_used: int
    residual_rms_m: float
    gdop: float


def no_fix(status: FixStatus, dimensions: int, gdop: float = np.inf) -> Fix:
    """The answer where there is no position."""
    return Fix(status, np.full(3, np.nan), np.full((3, 3), np.nan), dimensions, 0, np.nan, gdop)
