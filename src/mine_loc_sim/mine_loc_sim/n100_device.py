"""One N100 on a walker, as frames: 0x40 and 0x41 in turn, by the device's own clock."""

import itertools
import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from mine_loc_core.stamps import NS_PER_US
from mine_loc_pdr.fdilink import AhrsFrame, ImuFrame
from mine_loc_sim import scene_constants as sc
from mine_loc_sim.ahrs_output import AhrsOutput
from mine_loc_sim.imu_errors import FLU_TO_FRD, DeviceErrors, Imu
from mine_loc_sim.magnetic_field import GalleryField
from mine_loc_sim.waist_motion import WaistMotion
from mine_loc_sim.walker import Walker

_RATE_HZ = 0.5e6 / sc.N100_PERIOD_US
Timed = tuple[int, ImuFrame | AhrsFrame]


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

    def frames(self, stop_ns: int) -> list[Timed]:
        """Return the next frames with the instants of their measurements, until before `stop_ns`."""
        count = max(0, math.ceil(stop_ns / self._period_ns - self._phase) - self._sent)
        if not count:
            return []
        number = self._sent + np.arange(count)
        self._sent += count
        stamps = np.rint((number + self._phase) * self._period_ns).astype(np.int64)
        motion = self._walker.motion(stamps)
        device_us = self._first_us + number * sc.N100_PERIOD_US
        sensors = number % 2 == 0
        turns: list[list[Timed]] = [[], []]
        turns[int(number[0] % 2)] = self._sensor_frames(_pick(motion, sensors), device_us[sensors])
        turns[1 - int(number[0] % 2)] = self._attitude_frames(_pick(motion, ~sensors), device_us[~sensors])
        return [frame for pair in itertools.zip_longest(*turns) for frame in pair if frame is not None]

    def _sensor_frames(self, motion: WaistMotion, device_us: NDArray[np.int64]) -> list[Timed]:
        samples = self._imu.sample(motion, self._field.at(motion.position_m))
        columns = (samples.gyro_rad_s, samples.accel_m_s2, samples.mag_mg, samples.temperature_c, device_us)
        rows = zip(motion.stamp_ns.tolist(), *(column.tolist() for column in columns), strict=True)
        return [
            (t_ns, ImuFrame(tuple(gyro), tuple(accel), tuple(mag), warm_c, sc.ABSENT_BAROMETER_PA, warm_c, us))
            for t_ns, gyro, accel, mag, warm_c, us in rows
        ]

    def _attitude_frames(self, motion: WaistMotion, device_us: NDArray[np.int64]) -> list[Timed]:
        attitude = self._ahrs.estimate(motion)
        rates = (motion.angular_rate_rad_s @ self._to_device).astype(np.float32)
        columns = (rates, _euler_ned(attitude), attitude, device_us)
        rows = zip(motion.stamp_ns.tolist(), *(column.tolist() for column in columns), strict=True)
        return [(t_ns, AhrsFrame(tuple(rate), tuple(rpy), tuple(q), us)) for t_ns, rate, rpy, q, us in rows]


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


def _pick(motion: WaistMotion, which: NDArray[np.bool_]) -> WaistMotion:
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
