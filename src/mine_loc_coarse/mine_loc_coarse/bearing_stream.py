"""The bytes of direction-finding monitors to reports with ROS time."""

from collections import Counter, OrderedDict

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_coarse.monitor_clock import MonitorClock
from mine_loc_coarse.monitor_protocol import decoder
from mine_loc_core.stamps import NS_PER_S

_MOST_MONITORS = 256
_LAST_STAMP_NS = (2**31 - 1) * NS_PER_S


class BearingStream:
    """Decodes one line, on which several monitors may report.

    `by_monitor`: the monitors' clocks are ROS time. `losses` counts what was damaged or cannot be stamped, `reports`
    what was good.
    """

    def __init__(self, *, by_monitor: bool = False) -> None:
        self.by_monitor = by_monitor
        self.reports = 0
        self._impossible_stamps = 0
        self._decoder = decoder()
        self._clocks: OrderedDict[int, MonitorClock] = OrderedDict()

    @property
    def losses(self) -> Counter[str]:
        """By cause."""
        return Counter({**self._decoder.losses, "impossible_stamp": self._impossible_stamps})

    @property
    def clock_resets(self) -> int:
        """How often a monitor's clock was set anew."""
        return sum(clock.resets for clock in self._clocks.values())

    def feed(self, arrival_ns: int, data: bytes) -> list[tuple[BearingReport, int]]:
        """Reports that end with these bytes, each with the ROS time [ns] of its measurement."""
        stamped = [(report, self._stamp_ns(report, arrival_ns)) for report in self._decoder.feed(data)]
        good = [each for each in stamped if 0 <= each[1] <= _LAST_STAMP_NS]
        self._impossible_stamps += len(stamped) - len(good)
        self.reports += len(good)
        return good

    def reconnected(self) -> None:
        """Half a report, and clocks learnt before, are void."""
        self._decoder.reset()
        self._clocks.clear()

    def restart_clocks(self) -> None:
        """Offsets learnt against another time are void."""
        self._clocks.clear()

    def _stamp_ns(self, report: BearingReport, arrival_ns: int) -> int:
        if self.by_monitor:
            return report.stamp_ns
        clock = self._clocks.pop(report.monitor_id, None) or MonitorClock()
        self._clocks[report.monitor_id] = clock
        if len(self._clocks) > _MOST_MONITORS:
            self._clocks.popitem(last=False)
        return clock.stamp(report.stamp_ns, arrival_ns)
