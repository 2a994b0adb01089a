"""Moments of rest, in which a gyro shows its bias and nothing else."""

import math
from typing import TypeAlias

Vector3: TypeAlias = tuple[float, float, float]

WINDOW_S = 1.0
# A standing person sways: over the standing phases of ipol_gait_lowerback the medians of these are 0.014 rad/s and
# 0.027 m/s² in a second. The mean rate about the vertical, which alone turns the heading, scatters by 0.004 rad/s from
# one second to the next (1.48 times the median difference, over √2).
STILL_RATE_SD_RAD_S = 0.02
STILL_FORCE_SD_M_S2 = 0.06
MEAN_RATE_SD_RAD_S = 0.004


class RestDetector:
    """Looks at one second after the other and reports the mean angular rate of each in which the wearer was still."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Begin a new second."""
        self._span_s = 0.0
        self._count = 0
        self._x = self._y = self._z = self._force = 0.0
        self._rate_squares = self._force_squares = 0.0

    def push(self, dt_s: float, rate_rad_s: Vector3, force_m_s2: Vector3) -> Vector3 | None:
        """Take one sample; return the mean rate in rad/s, in the IMU's axes, of a second of rest when it ends."""
        x, y, z = rate_rad_s
        fx, fy, fz = force_m_s2
        squared_force = fx * fx + fy * fy + fz * fz
        self._span_s += dt_s
        self._count += 1
        self._x += x
        self._y += y
        self._z += z
        self._rate_squares += x * x + y * y + z * z
        self._force += math.sqrt(squared_force)
        self._force_squares += squared_force
        if self._span_s < WINDOW_S:
            return None
        mean = self._mean_if_still()
        self.reset()
        return mean

    def _mean_if_still(self) -> Vector3 | None:
        n = self._count
        x, y, z = self._x / n, self._y / n, self._z / n
        rate_variance = self._rate_squares / n - (x * x + y * y + z * z)
        force_variance = self._force_squares / n - (self._force / n) ** 2
        still = rate_variance < 3.0 * STILL_RATE_SD_RAD_S**2 and force_variance < STILL_FORCE_SD_M_S2**2
        return (x, y, z) if still else None
