"""What silence says: how probably a monitor hears an emitter at a place in a whole window."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
_LEAST_MISSED = 1e-3
"""A monitor may miss an emitter in range for a whole window, whatever the share that comes through: rock, a defect."""
_EDGE_M = 100.0
_STEPS = 24


@dataclass(frozen=True, slots=True)
class Coverage:
    """Monitors at `place_m` (m, 2) that hear as far as `range_m`, and the share `heard_share` of emissions there."""

    place_m: Array
    range_m: float
    heard_share: float

    def missed(self, position_m: Array, scans: Array, sd_m: Array | float = 0.0) -> Array:
        """Probability (n, m) that each monitor hears nothing in `scans` (n,) from `position_m` (n, 2) ± `sd_m` (n,)."""
        distance_m = np.hypot(*(position_m[:, None] - self.place_m).transpose(2, 0, 1))
        width_m = np.broadcast_to(np.hypot(_EDGE_M, sd_m), len(position_m))[:, None]
        within = 0.5 - 0.5 * np.tanh((distance_m - self.range_m) / (2.0 * width_m))
        heard = 1.0 - np.maximum((1.0 - self.heard_share) ** scans, _LEAST_MISSED)[:, None]
        missed: Array = 1.0 - within * heard
        return missed

    def single_m2(self, monitor: int, azimuth_rad: float, scans: float) -> float:
        """∫ r dr along a line, of the probability that its own monitor alone hears an emitter there [m² a radian]."""
        r = (np.arange(_STEPS) + 0.5) * (self.range_m / _STEPS)
        along = np.array([np.cos(azimuth_rad), np.sin(azimuth_rad)])
        missed = self.missed(self.place_m[monitor] + r[:, None] * along, np.full(_STEPS, scans))
        missed[:, monitor] = 1.0
        return float(np.sum(r * missed.prod(axis=1)) * (self.range_m / _STEPS))
