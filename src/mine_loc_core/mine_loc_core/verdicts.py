"""What became of a measurement, and why: the pure form of mine_loc_interfaces/MeasurementVerdict."""

from enum import IntEnum
from math import nan
from typing import NamedTuple


class Source(IntEnum):
    """Kind of measurement."""

    UNKNOWN = 0
    RANGE = 1
    TDOA = 2
    UWB_POSE = 3
    STEP = 4
    HEADING = 5
    LANDMARK = 6
    REGION = 7
    LINK_STATE = 8
    IMU = 9


class Reason(IntEnum):
    """Why a measurement was used or not."""

    UNKNOWN = 0
    ACCEPTED = 1
    GATE = 2
    KINEMATIC = 3
    STALE = 4
    FUTURE = 5
    DUPLICATE = 6
    INVALID = 7
    DISABLED = 8
    NOT_INITIALISED = 9
    FROZEN = 10
    UNKNOWN_SENSOR = 11
    DEGENERATE = 12
    AMBIGUOUS = 13
    BACKWARD = 14
    OVERFLOW = 15
    CAPTURE_GUARD = 16


class Verdict(NamedTuple):
    """Verdict on one measurement; NaN = not computed. `innovation` in m or rad, signed, a norm for vectors.

    A tuple, because one is made of every range of every round, in a third of the time.
    """

    source: Source
    sensor_id: int
    reason: Reason
    mahalanobis_sq: float = nan
    threshold: float = nan
    degrees_of_freedom: int = 0
    innovation: float = nan
    age_s: float = nan

    @property
    def accepted(self) -> bool:
        """Whether the measurement was used."""
        return self.reason is Reason.ACCEPTED
