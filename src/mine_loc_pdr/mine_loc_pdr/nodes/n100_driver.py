"""Node: one N100 on a serial line or TCP bridge to sensor_msgs (REP 145); runs in the namespace of its person."""

import sys
import threading
import time
from collections.abc import Iterable

from sensor_msgs.msg import FluidPressure, Imu, MagneticField

from mine_loc_core.device_clock import DeviceClock
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.node_base import Host, NodeBase
from mine_loc_core.nodes.qos import EVENTS
from mine_loc_core.nodes.ros_host import run
from mine_loc_core.serial_link import SerialLink
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_pdr.n100_stream import ImuMeasurement, N100Stream
from mine_loc_pdr.nodes.messages import Covariances, imu_frame, to_header, to_magnetic_field
from mine_loc_pdr.parameters import N100DriverParameters
from mine_loc_pdr.sensor_cdr import ImuWriter

_TICK_S = 1e-6
_COUNTER_BITS = 64
_SILENT_S = 0.8  # with diagnostics once a second, two seconds from the last byte to the error


class N100Driver(NodeBase):
    """Publishes imu/data, imu/mag and, where a barometer is fitted, imu/pressure."""

    default_name = "n100_driver"
    parameter_class = N100DriverParameters

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._decoding = threading.Lock()  # the reader's thread decodes and publishes; the executor does the rest

    def configure(self) -> None:
        """Create the publishers; the line is opened when the node becomes active."""
        for name in ("person", "port"):
            if not getattr(self.parameters, name):
                raise ConfigurationError(f"{self.name}: {name}: empty; allowed: any but an empty text")
        self._imu = self.publish_to(Imu, "imu/data", EVENTS)
        self._mag = self.publish_to(MagneticField, "imu/mag", EVENTS)
        self._pressure = self.publish_to(FluidPressure, "imu/pressure", EVENTS)
        self.parameters_changed()

    def activate(self) -> None:
        """Open the line, and keep opening it."""
        self._stream = N100Stream(self._new_clock())
        self._published = self._reported = self._lost = self._field_published = 0
        self._reported_at_s = time.monotonic()
        read = self.guarded(self._read, "serial data")
        self._link = SerialLink(self.parameters.port, self.parameters.baud, clock=self.now_ns, wake=read)
        self._link.start()

    def deactivate(self) -> None:
        """Close the line."""
        self._link.stop()

    def parameters_changed(self) -> None:
        """Work out the covariances, and the period of the magnetic field."""
        self._covariances = c = Covariances.of(self.parameters)
        self._writer = ImuWriter(imu_frame(self.parameters.person), c.orientation, c.rate, c.force)
        self._field_period_ns = round(NS_PER_S / self.parameters.magnetic_field_rate)

    def clock_jumped(self, delta_ns: int) -> None:
        """Map device time anew."""
        del delta_ns
        with self._decoding:
            self._stream.restart_clock(self._new_clock())

    def health(self) -> Iterable[Health]:
        """The line, what comes over it, and the clock."""
        return (self._line_health(), self._sample_health(), self._clock_health())

    def _new_clock(self) -> DeviceClock:
        p = self.parameters
        return DeviceClock(
            _TICK_S, _COUNTER_BITS, latency_ns=round(p.latency_ms * NS_PER_MS), bypass=p.stamp_on_arrival
        )

    def _read(self) -> None:
        with self._decoding:
            for chunk in self._link.take():
                if not chunk.data:
                    self._stream.reconnected()
                for measurement in self._stream.feed(chunk.arrival_ns, chunk.data):
                    self._publish(measurement)

    def _publish(self, measurement: ImuMeasurement) -> None:
        m = measurement
        self._imu.publish(self._writer.write(m.stamp_ns, m.orientation, m.rate_rad_s, m.force_m_s2))
        period = measurement.stamp_ns // self._field_period_ns
        if period != self._field_published and self._mag.get_subscription_count():
            self._field_published = period
            header = to_header(measurement, self.parameters.person)
            self._mag.publish(to_magnetic_field(measurement, header, self._covariances))
        if measurement.pressure_pa is not None:
            header = to_header(measurement, self.parameters.person)
            self._pressure.publish(FluidPressure(header=header, fluid_pressure=measurement.pressure_pa))
        self._published += 1

    def _line_health(self) -> Health:
        status = self._link.status
        values = {
            "port": status.port or self.parameters.port,
            "connections": status.connections,
            "bytes_read": status.bytes_read,
            "bytes_dropped": status.bytes_dropped,
        }
        if not status.port:
            level, message = Level.ERROR, f"down: {status.error}"
        elif status.silent_s > _SILENT_S:
            level, message = Level.ERROR, f"silent for {status.silent_s:.1f} s"
        else:
            level, message = Level.OK, "connected"
        return Health("serial line", level, message, values, hardware_id=self.parameters.port)

    def _sample_health(self) -> Health:
        now_s = time.monotonic()
        rate_hz = (self._published - self._reported) / max(now_s - self._reported_at_s, 1e-3)
        decoder = self._stream.decoder
        damage = {name: n for name, n in (decoder.losses + self._stream.faults).items() if name != "skipped_bytes"}
        lost_now = sum(damage.values()) - self._lost
        self._reported, self._reported_at_s, self._lost = self._published, now_s, sum(damage.values())
        skipped = {f"skipped_type_{kind:#04x}": n for kind, n in decoder.skipped_types.items()}
        values = {
            "rate_hz": f"{rate_hz:.1f}",
            "samples": self._published,
            "skipped_bytes": decoder.losses["skipped_bytes"],
        }
        values |= damage | skipped
        if not rate_hz:
            return Health("samples", Level.ERROR, "no samples", values, hardware_id=self.parameters.port)
        level = Level.WARN if lost_now else Level.OK
        return Health("samples", level, f"{rate_hz:.0f} Hz, {lost_now} lost or damaged", values, self.parameters.port)

    def _clock_health(self) -> Health:
        stamp = self._stream.last_stamp
        if stamp is None:
            return Health("device clock", Level.OK, "no device time yet")
        values = {"offset_ns": stamp.offset_ns, "skew_ppm": f"{stamp.skew_ppm:.1f}", "state": stamp.state.name}
        return Health("device clock", Level.OK, stamp.state.name.lower(), values, self.parameters.port)


def main() -> int:
    """Entry point."""
    return run(N100Driver)


if __name__ == "__main__":
    sys.exit(main())
