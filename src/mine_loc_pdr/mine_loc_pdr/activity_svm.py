"""A trained support vector machine as numbers (paper B, section 3.2.2), evaluated with plain numpy.

Training is scikit-learn's (`activity_training.py`); the decision function needs no more than a few products, is the
same in every version of it, and fits in a file without code.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Kernel: TypeAlias = Literal["linear", "poly", "rbf"]
POLY_DEGREE = 2
POLY_OFFSET = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Svm:
    """Decision f(x) = Σ coefficient_i K(support_i, z) + intercept of z = (x − mean) / scale, K one of

    linear zᵀs, poly (γ zᵀs + 1)², rbf exp(−γ |z − s|²).
    """

    kernel: Kernel
    gamma: float
    mean: Array  # (d,)
    scale: Array  # (d,), above 0
    support: Array  # (m, d), standardised
    coefficient: Array  # (m,)
    intercept: float

    def decision(self, features: Array) -> Array:
        """(n,) signed distance from the border, in margins, of features (n, d); above 0 is a turn (paper B: +1)."""
        z = (features - self.mean) / self.scale
        product = z @ self.support.T
        if self.kernel == "poly":
            product = (self.gamma * product + POLY_OFFSET) ** POLY_DEGREE
        elif self.kernel == "rbf":
            squares = (z**2).sum(axis=1)[:, None] + (self.support**2).sum(axis=1) - 2.0 * product
            product = np.exp(-self.gamma * squares)
        return np.asarray(product @ self.coefficient + self.intercept)
