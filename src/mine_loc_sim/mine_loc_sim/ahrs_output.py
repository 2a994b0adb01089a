"""The attitude that an N100 reports itself (FDILink 0x41), with magnetic aiding off as underground.

Its filter is not public. Its error is modelled by what any such filter leaves: a tilt that wanders about the truth, and
a heading that starts anywhere and drifts (`imu_constants`, all assumed).
"""

import math

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from mine_loc_core.quaternion import product
from mine_loc_sim import imu_constants as ic
from mine_loc_sim.waist_motion import WaistMotion

Float32Array = npt.NDArray[np.float32]


class AhrsOutput:
    """Attitude of one device at `rate_hz`; blocks in sequence, as from `Imu`."""

    def __init__(self, mounting: Rotation, rate_hz: float, rng: np.random.Generator) -> None:
        self._to_body_wxyz = mounting.inv().as_quat()[[3, 0, 1, 2]]
        self._tilt_rng, self._walk_rng = rng.spawn(2)
        self._keep = math.exp(-1.0 / (rate_hz * ic.AHRS_TILT_S))
        self._memory = self._keep * ic.AHRS_TILT_SD_RAD * self._tilt_rng.standard_normal((1, 2))
        self._heading_rad = rng.uniform(-math.pi, math.pi)
        self._drift_rad = ic.AHRS_DRIFT_SD_RAD_S * rng.standard_normal() / rate_hz
        self._walk_sd_rad = ic.AHRS_HEADING_WALK / math.sqrt(rate_hz)

    def estimate(self, motion: WaistMotion) -> Float32Array:
        """Quaternions w, x, y, z (n, 4), device FRD to NED, for the next n samples."""
        count = len(motion.stamp_ns)
        drive = ic.AHRS_TILT_SD_RAD * math.sqrt(1 - self._keep**2) * self._tilt_rng.standard_normal((count, 2))
        tilt, self._memory = lfilter([1.0], [1.0, -self._keep], drive, axis=0, zi=self._memory)
        drift = self._drift_rad + self._walk_sd_rad * self._walk_rng.standard_normal(count)
        heading = np.cumsum(np.concatenate([[self._heading_rad], drift]))
        self._heading_rad = float(heading[-1])
        turned = np.zeros((count, 4))
        turned[:, 0], turned[:, 3] = np.cos(0.5 * heading[:-1]), np.sin(0.5 * heading[:-1])
        tilted = Rotation.from_rotvec(np.pad(tilt, ((0, 0), (0, 1)))).as_quat()[:, [3, 0, 1, 2]]
        w, x, y, z = product(product(product(turned, tilted), motion.orientation_wxyz), self._to_body_wxyz).T
        ned: Float32Array = (np.column_stack([w + z, x + y, x - y, w - z]) * math.sqrt(0.5)).astype(np.float32)
        return ned
