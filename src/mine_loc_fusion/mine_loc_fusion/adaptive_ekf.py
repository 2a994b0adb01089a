"""The extended Kalman filter with a measurement noise that it learns from its innovations: a rival.

Sage and Husa, "Adaptive filtering with unknown prior statistics", Joint Automatic Control Conference 1969, with a
fading memory: R_k = (1 − d_k) R_{k−1} + d_k (ε εᵀ − P), d_k = (1 − b) / (1 − b^{k+1}).
"""

import numpy as np

from mine_loc_fusion.ekf import Ekf, EkfSettings
from mine_loc_fusion.estimate import Array


class AdaptiveEkf(Ekf):
    """Estimator of one person; `memory` is b."""

    def __init__(self, settings: EkfSettings | None = None, memory: float = 0.95) -> None:
        super().__init__(settings)
        self._memory = memory
        self._R: Array | None = None
        self._count = 0

    def _noise(self, R: Array, innovation: Array, P: Array) -> Array:
        self._count += 1
        share = (1.0 - self._memory) / (1.0 - self._memory ** (self._count + 1))
        before = R if self._R is None else self._R
        learnt = (1.0 - share) * before + share * (np.outer(innovation, innovation) - P)
        values, vectors = np.linalg.eigh((learnt + learnt.T) / 2.0)
        # ε εᵀ − P need not be positive: no less than a tenth of what positions claim
        self._R = (vectors * np.maximum(values, 0.1 * np.linalg.eigvalsh(R)[0])) @ vectors.T
        return self._R
