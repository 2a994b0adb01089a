"""The magnetic field in a gallery: Earth's, and that of rails, arches and machines, different every metre."""

import numpy as np
import numpy.typing as npt

from mine_loc_sim import imu_constants as ic

Array = npt.NDArray[np.float64]


class GalleryField:
    """Earth's field plus a fixed random field of Gaussian correlation (sum of plane waves, Rahimi and Recht 2007).

    Its magnitude never exceeds what has been captured underground from a real device. `steel_share` 0 leaves Earth's
    field alone.
    """

    def __init__(self, rng: np.random.Generator, steel_share: float = ic.STEEL_SD_SHARE) -> None:
        self._earth = np.array(ic.EARTH_FIELD_T)
        self._strength = float(np.linalg.norm(self._earth))
        self._waves = rng.standard_normal((3, ic.STEEL_WAVES)) / ic.STEEL_LENGTH_M
        self._phases = rng.uniform(0, 2 * np.pi, ic.STEEL_WAVES)
        deviation = steel_share * self._strength * np.sqrt(2 / ic.STEEL_WAVES)
        self._amplitudes = deviation * rng.standard_normal((ic.STEEL_WAVES, 3))

    def at(self, position_m: Array) -> Array:
        """Field (n, 3) in tesla, map frame, at positions (n, 3)."""
        field = self._earth + np.cos(position_m @ self._waves + self._phases) @ self._amplitudes
        magnitude = np.linalg.norm(field, axis=1, keepdims=True)
        limited: Array = field * np.minimum(1.0, ic.FIELD_LIMIT_SHARE * self._strength / magnitude)
        return limited
