"""One N100 on a walker, as frames: 0x40 and 0x41 in turn, by the device's own clock."""

import itertools
import math
from collections.abc import Collection, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mine_loc_core.stamps import NS_PER_US
from mine_loc_pdr import fdilink
from mine_loc_pdr.fdilink import AhrsFrame, ImuFrame
from mine_loc_sim import scene_constants as sc
from mine_loc_sim.ahrs_output import AhrsOutput
from mine_loc_sim.imu_errors import FLU_TO_FRD, DeviceErrors, Imu
from mine_loc_sim.magnetic_field import GalleryField
from mine_loc_sim.waist_motion import WaistMotion
from mine_loc_sim.walker import Walker

_RATE_HZ = 0.5e6 / sc.N100_PERIOD_US
Timed = tuple[int, ImuFrame | AhrsFrame]
Stamps = NDArray[np.int64]
Rows = NDArray[Any]
_NOTHING = np.empty(0, np.int64), np.empty(0, fdilink.IMU_ROW), np.empty(0, fdilink.AHRS_ROW)


class N100Frames(Collection[Timed]):
    """Frames 0x40 and 0x41 in turn with the instants of their measurements, kept as payloads until asked for.

    stamp_ns: (n,); sensors, attitudes: rows of `fdilink.IMU_ROW` and `fdilink.AHRS_ROW`, n together.
    """

    def __init__(self, stamp_ns: Stamps, sensors: Rows, attitudes: Rows, *, sensors_first: bool) -> None:
        self._stamp_ns, self._sensors, self._attitudes = stamp_ns, sensors, attitudes
        self._sensors_first = sensors_first

    def __len__(self) -> int:
        return len(self._stamp_ns)

    def __iter__(self) -> Iterator[Timed]:
        turns: list[Iterator[ImuFrame | AhrsFrame]] = [
            fdilink.imu_frames(self._sensors.tobytes()),
            fdilink.ahrs_frames(self._attitudes.tobytes()),
        ]
        pairs = itertools.zip_longest(*(turns if self._sensors_first else reversed(turns)))
        return zip(self._stamp_ns.tolist(), itertools.chain.from_iterable(pairs), strict=False)

    def __contains__(self, frame: object) -> bool:
        return any(each == frame for each in self)


class N100Device:
    """A device worn by `walker`; blocks must follow one another."""

    def __init__(self, errors: DeviceErrors, walker: Walker, field: GalleryField, rng: np.random.Generator) -> None:
        sensors, attitude, clock = rng.spawn(3)
        self._walker, self._field = walker, field
        self._imu = Imu(errors, _RATE_HZ, sensors)
        self._ahrs = AhrsOutput(errors.mounting, _RATE_HZ, attitude)
        self._to_device = errors.mounting.as_matrix().T * FLU_TO_FRD
        self._period_ns = (
            sc.N100_PERIOD_US * NS_PER_US / (1.0 + 1e-6 * sc.N100_CRYSTAL_SD_PPM * clock.standard_normal())
        )
        self._first_us = int(clock.integers(sc.N100_LONGEST_UP_S * 1_000_000))
        self._phase = clock.random()
        self._sent = 0

    def frames(self, stop_ns: int) -> "N100Frames":
        """Return the next frames with the instants of their measurements, until before `stop_ns`."""
        count = max(0, math.ceil(stop_ns / self._period_ns - self._phase) - self._sent)
        if not count:
            return N100Frames(*_NOTHING, sensors_first=True)
        number = self._sent + np.arange(count)
        self._sent += count
        stamps = np.rint((number + self._phase) * self._period_ns).astype(np.int64)
        motion = self._walker.motion(stamps)
        device_us = self._first_us + number * sc.N100_PERIOD_US
        first = int(number[0] % 2)  # even numbers are of sensors
        sensors, attitudes = slice(first, None, 2), slice(1 - first, None, 2)
        return N100Frames(
            stamps,
            self._sensor_rows(_pick(motion, sensors), device_us[sensors]),
            self._attitude_rows(_pick(motion, attitudes), device_us[attitudes]),
            sensors_first=first == 0,
        )

    def _sensor_rows(self, motion: WaistMotion, device_us: Stamps) -> Rows:
        samples = self._imu.sample(motion, self._field.at(motion.position_m))
        rows = np.empty(len(device_us), fdilink.IMU_ROW)
        values = rows["values"]
        values[:, 0:3], values[:, 3:6], values[:, 6:9] = samples.gyro_rad_s, samples.accel_m_s2, samples.mag_mg
        values[:, 9] = values[:, 11] = samples.temperature_c
        values[:, 10] = sc.ABSENT_BAROMETER_PA
        rows["timestamp_us"] = device_us
        return rows

    def _attitude_rows(self, motion: WaistMotion, device_us: Stamps) -> Rows:
        attitude = self._ahrs.estimate(motion)
        rows = np.empty(len(device_us), fdilink.AHRS_ROW)
        values = rows["values"]
        values[:, 0:3] = motion.angular_rate_rad_s @ self._to_device
        values[:, 3:6], values[:, 6:10] = _euler_ned(attitude), attitude
        rows["timestamp_us"] = device_us
        return rows


def mounted(errors: DeviceErrors, mounting_rpy_rad: tuple[float, float, float]) -> DeviceErrors:
    """Put a device that sits somewhat askew on a place where people.yaml says it sits (FLU body frame)."""
    roll, pitch, yaw = mounting_rpy_rad
    on_body = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    return DeviceErrors(errors.gyro, errors.accel, errors.mag, errors.mounting * on_body.inv(), errors.ambient_c)


def _euler_ned(attitude_wxyz: NDArray[np.float32]) -> NDArray[np.float32]:
    """Roll, pitch and heading 0..2 pi of (n, 4)."""
    w, x, y, z = attitude_wxyz.T.astype(np.float64)
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    heading = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)) % (2.0 * np.pi)
    return np.column_stack([roll, pitch, heading]).astype(np.float32)


def _pick(motion: WaistMotion, which: slice) -> WaistMotion:
    return WaistMotion(
        motion.stamp_ns[which],
        motion.position_m[which],
        motion.velocity_m_s[which],
        motion.acceleration_m_s2[which],
        motion.orientation_wxyz[which],
        motion.heading_rad[which],
        motion.angular_rate_rad_s[which],
        motion.specific_force_m_s2[which],
    )
