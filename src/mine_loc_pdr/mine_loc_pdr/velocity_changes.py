"""Changes of velocity from acceleration, for where there are no steps: the integral over tenths of a second, in odom.

What is integrated is the specific force turned by the attitude, less gravity (trapezium rule). It is handed on in
pieces, since its error grows with time: whoever knows positions knows what the pieces are worth.
"""

from dataclasses import dataclass

from mine_loc_core.stamps import NS_PER_MS, to_ns, to_s
from mine_loc_pdr.attitude import STANDARD_GRAVITY_M_S2, Quaternion, Vector3, rotated

INTERVAL_NS = 100 * NS_PER_MS
STEPLESS_NS = to_ns(1.5)
"""After the last step: a walker's steps tell the motion, and a waist that swings with them need not be reported."""


@dataclass(frozen=True, slots=True)
class VelocityChange:
    """By how much the velocity changed up to stamp_ns, in odom [m/s], over interval_s."""

    stamp_ns: int
    interval_s: float
    change_m_s: Vector3


class VelocityChanges:
    """Sums up one person's acceleration while there are no steps."""

    def __init__(self) -> None:
        self._stepped_ns: int | None = None
        self.interrupted()

    def interrupted(self) -> None:
        """What was between the last sample and the next is not known."""
        self._begun_ns: int | None = None
        self._before: Vector3 = (0.0, 0.0, 0.0)
        self._x = self._y = self._z = 0.0

    def stepped(self, stamp_ns: int) -> None:
        """A step was seen: what is summed up is forgotten, and nothing is for a while."""
        self._stepped_ns = stamp_ns
        self.interrupted()

    def push(self, stamp_ns: int, dt_s: float, orientation: Quaternion, force_m_s2: Vector3) -> VelocityChange | None:
        """Take a sample `dt_s` after the last; the change up to it, once a tenth of a second is full."""
        if self._stepped_ns is not None and 0 <= stamp_ns - self._stepped_ns < STEPLESS_NS:
            return None
        ax, ay, az = rotated(orientation, force_m_s2)
        az -= STANDARD_GRAVITY_M_S2
        (bx, by, bz), self._before = self._before, (ax, ay, az)
        if self._begun_ns is None:
            self._begun_ns = stamp_ns
            return None
        self._x += 0.5 * dt_s * (ax + bx)
        self._y += 0.5 * dt_s * (ay + by)
        self._z += 0.5 * dt_s * (az + bz)
        if stamp_ns - self._begun_ns < INTERVAL_NS:
            return None
        change = VelocityChange(stamp_ns, to_s(stamp_ns - self._begun_ns), (self._x, self._y, self._z))
        self._begun_ns, self._x, self._y, self._z = stamp_ns, 0.0, 0.0, 0.0
        return change
