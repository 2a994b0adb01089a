"""The byte stream of an N100 to stamped measurements in ROS conventions."""

import math
from collections import Counter
from dataclasses import dataclass

from mine_loc_core.device_clock import DeviceClock, DeviceStamp
from mine_loc_core.stamps import NS_PER_S
from mine_loc_pdr.attitude import turned
from mine_loc_pdr.fdilink import AhrsFrame, FdilinkDecoder, Frame, ImuFrame, Quaternion, RawSensorsFrame, Vector3
from mine_loc_pdr.n100_axes import enu_flu_from_ned_frd, field_tesla, flu_from_frd, pressure_pa

_US_PER_S = 1e6
_LONGEST_PERIOD_US = 100_000  # a longer pause between samples says nothing about their period


@dataclass(frozen=True, slots=True)
class ImuMeasurement:
    """One sample, forward-left-up; orientation is that of the body in east-north-up, w x y z, None = not known then."""

    stamp_ns: int
    rate_rad_s: Vector3
    force_m_s2: Vector3
    field_t: Vector3
    orientation: Quaternion | None
    pressure_pa: float | None


class N100Stream:
    """Decodes, stamps and converts what one N100 sends.

    A sample (0x40) gets the device's orientation (0x41) only where both are of the same instant within half a sample
    period; the gyro carries it over what is left. Raw sensors (0x58) carry no time and are stamped on arrival; they
    are used only while no calibrated samples come. `faults` counts frames with values that are not finite.
    """

    def __init__(self, clock: DeviceClock) -> None:
        self.decoder = FdilinkDecoder()
        self.faults: Counter[str] = Counter()
        self.last_stamp: DeviceStamp | None = None
        self._clock = clock
        self._ahrs: AhrsFrame | None = None
        self._imu: ImuFrame | None = None
        self._imu_arrival_ns: int | None = None

    def feed(self, arrival_ns: int, data: bytes) -> list[ImuMeasurement]:
        """Measurements completed by `data`, read at `arrival_ns` (ROS time), in order."""
        found = (self._take(frame, arrival_ns) for frame in self.decoder.feed(data))
        return [measurement for measurement in found if measurement is not None]

    def reconnected(self) -> None:
        """The line was opened anew: forget a partial frame and the orientation."""
        self.decoder.reset()
        self._ahrs = self._imu = None

    def restart_clock(self, clock: DeviceClock) -> None:
        """ROS time jumped: stamp by a clock that knows nothing of before."""
        self._clock = clock

    def _take(self, frame: Frame, arrival_ns: int) -> ImuMeasurement | None:
        if isinstance(frame, AhrsFrame):
            if _finite(*frame.orientation) and math.hypot(*frame.orientation) > 0.5:
                self._ahrs = frame
            else:
                self.faults["not_finite"] += 1
            return None
        if not _finite(*frame.angular_velocity_rad_s, *frame.specific_force_m_s2, *frame.magnetic_field_mg):
            self.faults["not_finite"] += 1
            return None
        if isinstance(frame, RawSensorsFrame):
            calibrated_ns = self._imu_arrival_ns
            if calibrated_ns is not None and arrival_ns - calibrated_ns < NS_PER_S:
                return None
            return _measurement(frame, self._clock.stamp(None, arrival_ns).stamp_ns, None)
        orientation = self._orientation_at(frame)
        self._imu, self._imu_arrival_ns = frame, arrival_ns
        self.last_stamp = self._clock.stamp(frame.timestamp_us, arrival_ns)
        return _measurement(frame, self.last_stamp.stamp_ns, orientation)

    def _orientation_at(self, frame: ImuFrame) -> Quaternion | None:
        """The device's orientation at the instant of `frame`, still north-east-down."""
        if self._ahrs is None or self._imu is None:
            return None
        period_us = frame.timestamp_us - self._imu.timestamp_us
        apart_us = frame.timestamp_us - self._ahrs.timestamp_us
        if not (0 < period_us <= _LONGEST_PERIOD_US and 2 * abs(apart_us) <= period_us):
            return None
        dt_s = apart_us / _US_PER_S
        x, y, z = frame.angular_velocity_rad_s
        return turned(self._ahrs.orientation, x * dt_s, y * dt_s, z * dt_s)


def _measurement(frame: ImuFrame | RawSensorsFrame, stamp_ns: int, orientation: Quaternion | None) -> ImuMeasurement:
    return ImuMeasurement(
        stamp_ns,
        flu_from_frd(frame.angular_velocity_rad_s),
        flu_from_frd(frame.specific_force_m_s2),
        field_tesla(frame.magnetic_field_mg),
        None if orientation is None else enu_flu_from_ned_frd(orientation),
        pressure_pa(frame),
    )


def _finite(*values: float) -> bool:
    return all(map(math.isfinite, values))
