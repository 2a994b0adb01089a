"""When the magnetic field may be trusted underground: a stretch of way over which it is the same everywhere.

Rails, arches and machines bend the field differently every metre, so a field that keeps its strength, its dip and its
direction against the gyro's heading over several metres is Earth's, or bent so evenly that it serves as well: what
counts is that it is the same as when it was first trusted. Near steel this is seldom so, and the field is left alone.
"""

import cmath
import math
from dataclasses import dataclass
from typing import TypeAlias

Vector3: TypeAlias = tuple[float, float, float]

STRETCH_M = 6.0  # assumed: three times the length over which steel bends the field alike
LONGEST_STRETCH_NS = 15_000_000_000  # who dawdles measures one place
EARTH_T = (20e-6, 70e-6)  # Earth's field is nowhere weaker or stronger at the ground
STRENGTH_SD_SHARE = 0.05
DIP_SD_RAD = math.radians(5.0)
AZIMUTH_SD_RAD = math.radians(6.0)
STEEPEST_DIP_RAD = math.radians(75.0)  # beyond it the horizontal part is too short to show a direction
_FEWEST_SAMPLES = 20


@dataclass(frozen=True, slots=True)
class TrustedField:
    """Means over a stretch: strength, dip below the horizon, azimuth in odom from x, counter-clockwise, and the heading
    walked.
    """

    strength_t: float
    dip_rad: float
    azimuth_rad: float
    heading_rad: float

    def resembles(self, other: "TrustedField") -> bool:
        """Whether strength and dip are the same, within what they may vary by on a stretch."""
        strength = abs(self.strength_t - other.strength_t) <= STRENGTH_SD_SHARE * other.strength_t
        return strength and abs(self.dip_rad - other.dip_rad) <= DIP_SD_RAD


class FieldStretch:
    """Gathers the field along the way, stretch by stretch."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin a stretch with the next sample."""
        self._count = 0
        self._begin_ns, self._begin_m = 0, 0.0
        self._strength = self._strength_squares = self._dip = self._dip_squares = 0.0
        self._azimuth = self._heading = 0j

    def push(self, stamp_ns: int, way_m: float, field_odom_t: Vector3, heading_rad: float) -> TrustedField | str | None:
        """Take a sample at `way_m` metres walked; at the end of a stretch its field, or the check it failed."""
        if not self._count:
            self._begin_ns, self._begin_m = stamp_ns, way_m
        self._count += 1
        x, y, z = field_odom_t
        horizontal = math.hypot(x, y)
        strength, dip = math.hypot(horizontal, z), math.atan2(-z, horizontal)
        self._strength += strength
        self._strength_squares += strength * strength
        self._dip += dip
        self._dip_squares += dip * dip
        self._azimuth += cmath.rect(1.0, math.atan2(y, x))
        self._heading += cmath.rect(1.0, heading_rad)
        dawdled = stamp_ns - self._begin_ns > LONGEST_STRETCH_NS
        if way_m - self._begin_m < STRETCH_M and not dawdled:
            return None
        verdict = "too_slow" if dawdled else self._judge()
        self.reset()
        return verdict

    def _judge(self) -> TrustedField | str:
        n = self._count
        strength, dip = self._strength / n, self._dip / n
        failed = {
            "too_few": n < _FEWEST_SAMPLES,
            "not_earths": not EARTH_T[0] <= strength <= EARTH_T[1],
            "strength_varies": self._strength_squares / n - strength**2 > (STRENGTH_SD_SHARE * strength) ** 2,
            "too_steep": abs(dip) > STEEPEST_DIP_RAD,
            "dip_varies": self._dip_squares / n - dip**2 > DIP_SD_RAD**2,
            # The mean resultant of a wrapped normal distribution of this deviation.
            "against_gyro": abs(self._azimuth) / n < math.exp(-0.5 * AZIMUTH_SD_RAD**2),
        }
        first = next((check for check, fails in failed.items() if fails), None)
        return first or TrustedField(strength, dip, cmath.phase(self._azimuth), cmath.phase(self._heading))
