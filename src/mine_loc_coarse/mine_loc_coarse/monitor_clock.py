"""A monitor's own time to ROS time, by the reports that came quickest.

Reports overtake each other and come seconds late, but never early: the least difference of arrival and stamp is the
clocks' offset and the shortest way. It is kept by bins, so that a drifting clock is followed.
"""

from collections import deque

from mine_loc_core.stamps import NS_PER_S

_BIN_NS = 10 * NS_PER_S
_BINS = 30
_SET_ANEW_NS = 60 * NS_PER_S
"""No report is so late: a difference that grows by more is a clock that was set anew."""


class MonitorClock:
    """Maps the stamps of one monitor. `resets` counts how often its clock was set anew."""

    def __init__(self) -> None:
        self._least: deque[tuple[int, int]] = deque(maxlen=_BINS)  # (arrival of the bin, least difference in it)
        self.resets = 0

    def stamp(self, monitor_ns: int, arrival_ns: int) -> int:
        """ROS time of what the monitor stamped `monitor_ns` and what arrived at `arrival_ns`; never after that."""
        difference_ns = arrival_ns - monitor_ns
        if self._least and abs(difference_ns - min(least for _, least in self._least)) > _SET_ANEW_NS:
            self._least.clear()
            self.resets += 1
        begin_ns = arrival_ns // _BIN_NS
        if self._least and self._least[-1][0] == begin_ns:
            self._least[-1] = begin_ns, min(self._least[-1][1], difference_ns)
        else:
            self._least.append((begin_ns, difference_ns))
        return monitor_ns + min(least for _, least in self._least)
