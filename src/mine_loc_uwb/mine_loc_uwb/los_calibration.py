"""Temperature scaling: one number that makes probabilities as sure as they are right (Guo et al., ICML 2017)."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

_LEAST, _MOST = 1.0, 5.0
"""Never below 1: a placement that fools every network is missing from the others' folds when it is held out itself,
and that must not make them sound surer."""


def fit_temperature(logits: NDArray[np.float64], los: NDArray[np.bool_], weight: NDArray[np.float64]) -> float:
    """Temperature by which to divide logits (n,) of frames not trained on, for least cost; weight: (n,), sum 1."""
    sign = np.where(los, 1.0, -1.0)

    def cost(log_temperature: float) -> float:
        return float(np.logaddexp(0.0, -sign * logits / np.exp(log_temperature)) @ weight)

    found = minimize_scalar(cost, bounds=(np.log(_LEAST), np.log(_MOST)), method="bounded")
    return float(np.exp(found.x))
