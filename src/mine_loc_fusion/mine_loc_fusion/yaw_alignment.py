"""Yaw of the odom frame in the map: the rotation that lays a dead-reckoned track over positions."""

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from mine_loc_fusion.estimate import Array

_BASELINE_M = 3.0
_PAIRS = 40
_LEAST_SD_M = 0.05
_LEAST_SD_RAD = math.radians(5.0)


@dataclass(slots=True)
class YawAlignment:
    """Collects steps and positions until a track is long enough to tell the rotation."""

    odom_m: Array = field(default_factory=lambda: np.zeros(2))
    pairs: deque[tuple[Array, Array]] = field(default_factory=lambda: deque(maxlen=_PAIRS))

    def step(self, length_m: float, heading_rad: float, position_m: Array) -> tuple[float, float] | None:
        """Add a step and where the person was after it (2,); yaw and its variance once they can be told.

        Least squares over rotation and scale (Horn, "Closed-form solution of absolute orientation", JOSA A 4, 1987).
        """
        self.odom_m = self.odom_m + length_m * np.array([math.cos(heading_rad), math.sin(heading_rad)])
        self.pairs.append((self.odom_m, position_m.copy()))
        odom, seen = (np.array(each) for each in zip(*self.pairs, strict=True))
        odom, seen = odom - odom.mean(axis=0), seen - seen.mean(axis=0)
        if np.ptp(odom, axis=0).max() < _BASELINE_M:
            return None
        spread_m2 = float(np.sum(odom**2))
        dot = float(np.sum(odom * seen))
        cross = float(np.sum(odom[:, 0] * seen[:, 1] - odom[:, 1] * seen[:, 0]))
        c, s = dot / spread_m2, cross / spread_m2
        residual = seen - odom @ np.array([[c, s], [-s, c]])
        sd_m = max(math.sqrt(float(np.mean(residual**2))), _LEAST_SD_M)
        return math.atan2(cross, dot), sd_m**2 / spread_m2 + _LEAST_SD_RAD**2

    def copy(self) -> "YawAlignment":
        """What is added to one is not added to the other."""
        return YawAlignment(self.odom_m, self.pairs.copy())

    def forget_places(self) -> None:
        """Positions before and after a new start are not of one track."""
        self.pairs.clear()
