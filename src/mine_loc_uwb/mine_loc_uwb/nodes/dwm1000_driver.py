"""The serial line of a DW1000 kit: bytes to ranges, time differences and CIR frames."""

import sys
import threading
import time
from collections.abc import Iterable
from pathlib import Path

from mine_loc_interfaces.msg import CirFrameArray, DeviceInfo, TdoaArray, UwbRangeArray

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.node_base import Host, NodeBase
from mine_loc_core.nodes.qos import EVENTS, LATCHED
from mine_loc_core.nodes.ros_host import run
from mine_loc_core.serial_link import Chunk, SerialLink
from mine_loc_core.site import load_site
from mine_loc_core.stamps import NS_PER_MS
from mine_loc_uwb.device_stamps import DeviceStamps
from mine_loc_uwb.nodes.line_messages import LineIds, stamped_message
from mine_loc_uwb.parameters import Dwm1000DriverParameters
from mine_loc_uwb.window_gatherer import Gathered, WindowGatherer
from mine_loc_uwb.wire.detect import AutoDetect, make_decoder
from mine_loc_uwb.wire.starting import make_starter

_INCOMPLETE_S = 0.02
"""So long after its last accumulator the rest of a round is not waited for."""


class Dwm1000Driver(NodeBase):
    """Reads one port for ever and publishes what its messages say, stamped with the instant of measurement."""

    default_name = "dwm1000_driver"
    parameter_class = Dwm1000DriverParameters

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._decoding = threading.Lock()  # the reader's thread decodes and publishes; the executor does the rest

    def configure(self) -> None:
        """Create publishers; nothing is opened yet. A receiver that site.yaml does not know refuses the transition."""
        self._ids = self._ids_of_line()
        self._ranges = self.publish_to(UwbRangeArray, "uwb/ranges", EVENTS)
        self._tdoa = self.publish_to(TdoaArray, "uwb/tdoa", EVENTS)
        self._cir = self.publish_to(CirFrameArray, "uwb/cir", EVENTS)
        self._info = self.publish_to(DeviceInfo, "~/device_info", LATCHED)
        self.every(0.05, self._talk)

    def activate(self) -> None:
        """Open the port, now or as soon as it appears."""
        p = self.parameters
        self._decoder = AutoDetect() if p.format == "auto" else make_decoder(p.format)
        self._gatherer = WindowGatherer()
        self._starter = make_starter(p.format)
        self._stamps = self._new_stamps()
        self._announced = ""
        self._messages = 0
        self._losses_before = 0
        self._last_message = time.monotonic()
        read = self.guarded(self._read, "serial data")
        self._link = SerialLink(p.port, p.baud, clock=self.now_ns, wake=read)
        self._link.start()

    def deactivate(self) -> None:
        """Close the port."""
        self._link.stop()

    def parameters_changed(self) -> None:
        """Latency and trust in the device's clock take effect at once."""
        with self._decoding:
            self._stamps = self._new_stamps()

    def clock_jumped(self, delta_ns: int) -> None:  # noqa: ARG002
        """Offsets learnt against the old time are void."""
        with self._decoding:
            self._stamps.forget()

    def health(self) -> Iterable[Health]:
        """The line, and what is decoded from it."""
        status = self._link.status
        silent_s = time.monotonic() - self._last_message
        if not status.port:
            yield Health("port", Level.ERROR, status.error, {"port": self.parameters.port})
        elif silent_s > self.parameters.silence_s:
            yield Health("port", Level.ERROR, f"no message for {silent_s:.1f} s", {"port": status.port})
        else:
            yield Health("port", Level.OK, f"reading {status.port}", {"connections": status.connections})
        losses = sum(self._decoder.losses.values())
        level = Level.WARN if losses > self._losses_before else Level.OK
        self._losses_before = losses
        figures = {
            "messages": self._messages,
            "lost_rounds": self._stamps.lost_rounds,
            "clock_resets": self._stamps.clock_resets,
            "bytes": status.bytes_read,
            "bytes_dropped": status.bytes_dropped,
        }
        yield Health("decoder", level, self._decoder.name, figures | dict(self._decoder.losses))

    def _new_stamps(self) -> DeviceStamps:
        latency_ns = round(self.parameters.latency_ms * NS_PER_MS)
        return DeviceStamps(latency_ns=latency_ns, trust_device_clock=self.parameters.trust_device_clock)

    def _read(self) -> None:
        with self._decoding:
            for chunk in self._link.take():
                self._decode(chunk)

    def _decode(self, chunk: Chunk) -> None:
        if not chunk.data:
            self._decoder.reset()
            self._gatherer.reset()
            self._starter.reset()
            self._stamps.forget()
            return
        self._starter.observe(chunk.data)
        self._arrival_ns = chunk.arrival_ns
        for message in self._decoder.feed(chunk.data):
            self._messages += 1
            self._last_message = time.monotonic()
            if self._decoder.name != self._announced:
                self._announce()
            self._publish(self._gatherer.take(message))

    def _publish(self, messages: Iterable[Gathered]) -> None:
        publishers = {UwbRangeArray: self._ranges, TdoaArray: self._tdoa, CirFrameArray: self._cir}
        for message in messages:
            if isinstance(message, tuple) and not self._cir.get_subscription_count():
                continue
            sd_m = self.parameters.range_sd_m
            stamped = stamped_message(message, self._decoder, self._stamps, self._arrival_ns, self._ids, sd_m)
            if stamped is not None:
                publishers[type(stamped)].publish(stamped)

    def _ids_of_line(self) -> LineIds:
        """What site.yaml says of this line."""
        p = self.parameters
        if not (p.site and p.receiver):
            return LineIds()
        receivers = {receiver.name: receiver for receiver in load_site(Path(p.site)).uwb_receivers}
        if p.receiver not in receivers:
            raise ConfigurationError(f"receiver: {p.receiver!r} is not in site.yaml; allowed: {', '.join(receivers)}")
        receiver = receivers[p.receiver]
        return LineIds(receiver.tag_id, receiver.anchor_id or 0)

    def _announce(self) -> None:
        self._announced = self._decoder.name
        info = DeviceInfo(
            device="DW1000",
            port=self._link.status.port,
            wire_format=self._decoder.name,
            tick_period=self._decoder.tick_period_s,
            counter_bits=self._decoder.counter_bits,
        )
        info.header.stamp = to_time(self.now_ns())
        self._info.publish(info)

    def _talk(self) -> None:
        silent_s = time.monotonic() - self._last_message
        alive = silent_s < self.parameters.silence_s
        with self._decoding:
            if silent_s > _INCOMPLETE_S:
                self._publish(self._gatherer.release())
            words = self._starter.poll(time.monotonic_ns(), stream_alive=alive)
        self._link.write(words)


def main() -> int:
    """Entry point."""
    return run(Dwm1000Driver)


if __name__ == "__main__":
    sys.exit(main())
