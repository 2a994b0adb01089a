"""What a waist-worn N100 reports of a true motion: mounting, scale, bias, noise, range and float32, in its FRD axes.

No noise figures of the N100 are public: the defaults are those of its class (`imu_constants`).
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_S
from mine_loc_sim import imu_constants as ic
from mine_loc_sim.waist_motion import StampArray, WaistMotion

Array = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
FLU_TO_FRD = np.array([1.0, -1.0, -1.0])
MILLIGAUSS_PER_TESLA = 1e7


@dataclass(frozen=True, slots=True, eq=False)
class ImuSamples:
    """What the device measures, n samples in its own forward-right-down axes and FDILink's units (0x40)."""

    stamp_ns: StampArray
    gyro_rad_s: Float32Array
    accel_m_s2: Float32Array
    mag_mg: Float32Array
    temperature_c: Float32Array


@dataclass(frozen=True, slots=True, eq=False)
class Triad:
    """Errors of three orthogonal sensors in their unit: measured = matrix · true + bias(temperature, time) + noise.

    `noise_density` is per √Hz, `instability` the deviation of a slow Gauss-Markov bias, `limit` the largest output.
    """

    matrix: Array
    turn_on_bias: Array
    bias_per_kelvin: Array
    noise_density: float
    instability: float
    limit: float


@dataclass(frozen=True, slots=True, eq=False)
class DeviceErrors:
    """One device as it was built and put on: `mounting` turns body FLU vectors into device FLU ones."""

    gyro: Triad
    accel: Triad
    mag: Triad
    mounting: Rotation
    ambient_c: float


def ideal_device() -> DeviceErrors:
    """A device without any error, mounted straight: what remains is the change of axes and float32."""

    def perfect() -> Triad:
        return Triad(np.eye(3), np.zeros(3), np.zeros(3), 0.0, 0.0, math.inf)

    return DeviceErrors(perfect(), perfect(), perfect(), Rotation.identity(), ic.AMBIENT_C)


def draw_device(rng: np.random.Generator) -> DeviceErrors:
    """Draw a device from the class of the N100."""

    def triad(spec: ic.TriadSpec) -> Triad:
        matrix = np.eye(3) + np.diag(spec.scale_sd * rng.standard_normal(3))
        matrix += spec.misalignment_sd_rad * rng.standard_normal((3, 3)) * (1 - np.eye(3))
        turn_on = rng.uniform(*spec.turn_on_bias, 3) * rng.choice([-1.0, 1.0], 3)
        drift = spec.bias_per_kelvin_sd * rng.standard_normal(3)
        return Triad(
            matrix, turn_on, drift, rng.uniform(*spec.noise_density), rng.uniform(*spec.instability), spec.limit
        )

    mounting = Rotation.from_euler("ZYX", ic.MOUNTING_SD_RAD * rng.standard_normal(3))
    return DeviceErrors(triad(ic.GYRO), triad(ic.ACCEL), triad(ic.MAG), mounting, ic.AMBIENT_C)


class Imu:
    """A device that samples at `rate_hz`; blocks of any size in sequence give the same samples as one large block."""

    def __init__(self, errors: DeviceErrors, rate_hz: float, rng: np.random.Generator) -> None:
        low, high = ic.RATE_HZ_RANGE
        if not low <= rate_hz <= high:
            raise ConfigurationError(f"imu: rate_hz {rate_hz}, allowed: {low} to {high}")
        self.rate_hz = rate_hz
        self._errors = errors
        gyro, accel, mag = rng.spawn(3)
        self._gyro = _TriadState(errors.gyro, rate_hz, gyro)
        self._accel = _TriadState(errors.accel, rate_hz, accel)
        self._mag = _TriadState(errors.mag, rate_hz, mag)
        self._samples = 0

    def stamps_ns(self, start_ns: int, stop_ns: int) -> StampArray:
        """Sampling instants from `start_ns` until before `stop_ns`, each rounded by itself so that none drifts."""
        count = math.ceil((stop_ns - start_ns) * self.rate_hz / NS_PER_S)
        offsets: StampArray = np.rint(np.arange(count) * (NS_PER_S / self.rate_hz)).astype(np.int64)
        return start_ns + offsets

    def sample(self, motion: WaistMotion, magnetic_field_t: Array) -> ImuSamples:
        """Measure the next n samples; `magnetic_field_t` (n, 3) is the field at the device, map frame, in tesla."""
        count = len(motion.stamp_ns)
        age_s = (self._samples + np.arange(count)) / self.rate_hz
        self._samples += count
        warm_k = ic.SELF_HEATING_K * -np.expm1(-age_s / ic.SELF_HEATING_S)
        attitude = Rotation.from_quat(motion.orientation_wxyz[:, [1, 2, 3, 0]])
        field_mg = attitude.apply(magnetic_field_t, inverse=True) * MILLIGAUSS_PER_TESLA
        mounting = self._errors.mounting.as_matrix().T * FLU_TO_FRD
        return ImuSamples(
            motion.stamp_ns,
            self._gyro.measure(motion.angular_rate_rad_s @ mounting, warm_k),
            self._accel.measure(motion.specific_force_m_s2 @ mounting, warm_k),
            self._mag.measure(field_mg @ mounting, warm_k),
            (self._errors.ambient_c + warm_k).astype(np.float32),
        )


class _TriadState:
    """A triad with its slow bias and its noise streams."""

    def __init__(self, errors: Triad, rate_hz: float, rng: np.random.Generator) -> None:
        self._errors = errors
        self._noise_rng, self._bias_rng = rng.spawn(2)
        self._keep = math.exp(-1.0 / (rate_hz * ic.INSTABILITY_S))
        self._noise_sd = errors.noise_density * math.sqrt(rate_hz / 2)
        first = errors.instability * self._bias_rng.standard_normal((1, 3))
        self._memory = self._keep * first

    def measure(self, true: Array, warm_k: Array) -> Float32Array:
        """Add the errors to true values (n, 3) in device axes."""
        e = self._errors
        drive = e.instability * math.sqrt(1 - self._keep**2) * self._bias_rng.standard_normal(true.shape)
        slow, self._memory = lfilter([1.0], [1.0, -self._keep], drive, axis=0, zi=self._memory)
        noise = self._noise_sd * self._noise_rng.standard_normal(true.shape)
        value = true @ e.matrix.T + e.turn_on_bias + np.outer(warm_k, e.bias_per_kelvin) + slow + noise
        limited: Float32Array = np.clip(value, -e.limit, e.limit).astype(np.float32)
        return limited
