"""How fast a shuttle car may drive, from what mine_loc says of the people near it. No ROS in here.

It needs a permission to move at all, and that runs out: what is not heard is a reason to stop.
"""

import math
from dataclasses import dataclass

_COUNTS = 2**32
_MOST_LOST = 10


@dataclass(frozen=True)
class Speeds:
    """Metres a second: with nobody near, and with somebody in the warning zone."""

    full: float
    slow: float


class SpeedLimit:
    """Times are seconds of a steady clock."""

    def __init__(self, speeds: Speeds) -> None:
        self._speeds = speeds
        self._heartbeat: int | None = None
        self._permitted_until_s = -math.inf
        self._warned = True  # until the alarms have been heard

    def take_stop(self, *, stop: bool, heartbeat: int, valid_for_s: float, age_s: float, now_s: float) -> None:
        """Take a message of proximity/stop for this vehicle that was `age_s` old when it arrived."""
        last, self._heartbeat = self._heartbeat, heartbeat
        beats = last is not None and 1 <= (heartbeat - last) % _COUNTS <= _MOST_LOST
        good = not stop and beats and abs(age_s) <= valid_for_s
        self._permitted_until_s = now_s + valid_for_s - max(age_s, 0.0) if good else -math.inf

    def take_alarms(self, *, warned: bool) -> None:
        """Take a message of proximity/alarms: whether anybody is in a zone of this vehicle."""
        self._warned = warned

    def limited_m_s(self, wanted_m_s: float, now_s: float) -> float:
        """The wanted speed, forward or backward, as far as it is allowed now."""
        limit = self._speeds.slow if self._warned else self._speeds.full
        if now_s > self._permitted_until_s or not math.isfinite(wanted_m_s):
            return 0.0
        return max(-limit, min(limit, wanted_m_s))
