"""Node: the line of a direction-finding monitor, serial or TCP, to bearings."""

import math
import sys
import threading
import time
from collections.abc import Iterable

from mine_loc_interfaces.msg import BearingArray

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_coarse.bearing_stream import BearingStream
from mine_loc_coarse.nodes.messages import to_bearing_arrays
from mine_loc_coarse.parameters import MonitorDriverParameters
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.node_base import Host, NodeBase
from mine_loc_core.nodes.qos import EVENTS
from mine_loc_core.nodes.ros_host import run
from mine_loc_core.serial_link import Chunk, SerialLink


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
        self._stream = BearingStream(by_monitor=p.stamp_by_monitor)
        self._losses_before = 0
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
            self._stream.by_monitor = self.parameters.stamp_by_monitor
            self._stream.restart_clocks()

    def clock_jumped(self, delta_ns: int) -> None:  # noqa: ARG002
        """Offsets learnt against the old time are void."""
        with self._decoding:
            self._stream.restart_clocks()

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
        losses = self._stream.losses
        level = Level.WARN if losses.total() > self._losses_before else Level.OK
        self._losses_before = losses.total()
        figures = {"reports": self._stream.reports, "bytes": status.bytes_read, "bytes_dropped": status.bytes_dropped}
        figures["clock_resets"] = self._stream.clock_resets
        yield Health("decoder", level, "mldf", figures | dict(losses))

    def _read(self) -> None:
        with self._decoding:
            for chunk in self._link.take():
                self._decode(chunk)

    def _decode(self, chunk: Chunk) -> None:
        if not chunk.data:
            self._stream.reconnected()
        elif reports := self._stream.feed(chunk.arrival_ns, chunk.data):
            self._publish(reports)

    def _publish(self, reports: list[tuple[BearingReport, int]]) -> None:
        self._last_report_s = time.monotonic()
        for message in to_bearing_arrays(reports, math.radians(self.parameters.azimuth_sd_deg) ** 2):
            self._bearings.publish(message)


def main() -> int:
    """Entry point."""
    return run(MonitorDriver)


if __name__ == "__main__":
    sys.exit(main())
