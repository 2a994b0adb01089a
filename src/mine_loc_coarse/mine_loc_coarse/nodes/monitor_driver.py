"""Node: the line of a direction-finding monitor, serial or TCP, to bearings."""

import math
import sys
import threading
import time
from collections import OrderedDict
from collections.abc import Iterable

from mine_loc_interfaces.msg import BearingArray

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_coarse.monitor_clock import MonitorClock
from mine_loc_coarse.monitor_protocol import decoder
from mine_loc_coarse.nodes.messages import to_bearing
from mine_loc_coarse.parameters import MonitorDriverParameters
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.node_base import Host, NodeBase
from mine_loc_core.nodes.qos import EVENTS
from mine_loc_core.nodes.ros_host import run
from mine_loc_core.serial_link import Chunk, SerialLink

_MOST_MONITORS = 256
_MOST_BEARINGS = 4096
_LAST_STAMP_NS = (2**31 - 1) * 1_000_000_000


class MonitorDriver(NodeBase):
    """Reads one port for ever and publishes coarse/bearings, stamped with the instants of measurement."""

    default_name = "monitor_driver"
    parameter_class = MonitorDriverParameters

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._decoding = threading.Lock()  # the reader's thread decodes and publishes; the executor does the rest

    def configure(self) -> None:
        """Create the publisher; nothing is opened yet."""
        if not self.parameters.port:
            raise ConfigurationError(f"{self.name}: port: empty; allowed: any but an empty text")
        self._bearings = self.publish_to(BearingArray, "coarse/bearings", EVENTS)

    def activate(self) -> None:
        """Open the port, now or as soon as it appears."""
        p = self.parameters
        self._decoder = decoder()
        self._clocks: OrderedDict[int, MonitorClock] = OrderedDict()
        self._reports = self._losses_before = self._impossible_stamps = 0
        self._last_report_s = time.monotonic()
        read = self.guarded(self._read, "serial data")
        self._link = SerialLink(p.port, p.baud, clock=self.now_ns, wake=read, silence_s=p.silence_s)
        self._link.start()

    def deactivate(self) -> None:
        """Close the port."""
        self._link.stop()

    def parameters_changed(self) -> None:
        """Trust in the monitors' clocks takes effect at once."""
        with self._decoding:
            self._clocks.clear()

    def clock_jumped(self, delta_ns: int) -> None:  # noqa: ARG002
        """Offsets learnt against the old time are void."""
        with self._decoding:
            self._clocks.clear()

    def health(self) -> Iterable[Health]:
        """The line, and what is decoded from it."""
        status = self._link.status
        silent_s = time.monotonic() - self._last_report_s
        if not status.port:
            yield Health("port", Level.ERROR, status.error, {"port": self.parameters.port})
        elif silent_s > self.parameters.silence_s:
            yield Health("port", Level.ERROR, f"no report for {silent_s:.1f} s", {"port": status.port})
        else:
            yield Health("port", Level.OK, f"reading {status.port}", {"connections": status.connections})
        losses = sum(self._decoder.losses.values()) + self._impossible_stamps
        level = Level.WARN if losses > self._losses_before else Level.OK
        self._losses_before = losses
        figures = {"reports": self._reports, "bytes": status.bytes_read, "bytes_dropped": status.bytes_dropped}
        figures["impossible_stamp"] = self._impossible_stamps
        figures["clock_resets"] = sum(clock.resets for clock in self._clocks.values())
        yield Health("decoder", level, "mldf", figures | dict(self._decoder.losses))

    def _read(self) -> None:
        with self._decoding:
            for chunk in self._link.take():
                self._decode(chunk)

    def _decode(self, chunk: Chunk) -> None:
        if not chunk.data:
            self._decoder.reset()
            self._clocks.clear()
            return
        reports = self._decoder.feed(chunk.data)
        if reports:
            self._publish(reports, chunk.arrival_ns)

    def _publish(self, reports: list[BearingReport], arrival_ns: int) -> None:
        self._reports += len(reports)
        self._last_report_s = time.monotonic()
        variance_rad2 = math.radians(self.parameters.azimuth_sd_deg) ** 2
        stamped = [(report, self._stamp_ns(report, arrival_ns)) for report in reports]
        good = [each for each in stamped if 0 <= each[1] <= _LAST_STAMP_NS]
        self._impossible_stamps += len(stamped) - len(good)
        for start in range(0, len(good), _MOST_BEARINGS):
            part = good[start : start + _MOST_BEARINGS]
            message = BearingArray(bearings=[to_bearing(report, stamp_ns, variance_rad2) for report, stamp_ns in part])
            message.header.stamp = to_time(max(stamp_ns for _, stamp_ns in part))
            message.header.frame_id = "map"
            self._bearings.publish(message)

    def _stamp_ns(self, report: BearingReport, arrival_ns: int) -> int:
        """ROS time of a measurement."""
        if self.parameters.stamp_by_monitor:
            return report.stamp_ns
        clock = self._clocks.pop(report.monitor_id, None) or MonitorClock()
        self._clocks[report.monitor_id] = clock
        if len(self._clocks) > _MOST_MONITORS:
            self._clocks.popitem(last=False)
        return clock.stamp(report.stamp_ns, arrival_ns)


def main() -> int:
    """Entry point."""
    return run(MonitorDriver)


if __name__ == "__main__":
    sys.exit(main())
