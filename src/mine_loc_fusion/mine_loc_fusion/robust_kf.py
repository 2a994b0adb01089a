"""The Kalman filter that weakens a position as far as its innovation is too large: a rival.

Chang, "Robust Kalman filtering based on Mahalanobis distance as outlier judging criterion", Journal of Geodesy 88,
2014: where d² exceeds its quantile, the noise is inflated until it does not (for a diagonal S, by the factor d² over
the quantile).
"""

import numpy as np

from mine_loc_core.gates import chi2_quantile
from mine_loc_fusion.ekf import Ekf, EkfSettings
from mine_loc_fusion.estimate import Array


class RobustKf(Ekf):
    """Estimator of one person; `trust` is the share of good positions that are taken as they come."""

    def __init__(self, settings: EkfSettings | None = None, trust: float = 0.95) -> None:
        super().__init__(settings)
        self._judging = chi2_quantile(trust, 2)

    def _noise(self, R: Array, innovation: Array, P: Array) -> Array:
        d2 = float(innovation @ np.linalg.solve(P + R, innovation))
        if d2 <= self._judging:
            return R
        inflated: Array = (P + R) * (d2 / self._judging) - P
        return inflated
