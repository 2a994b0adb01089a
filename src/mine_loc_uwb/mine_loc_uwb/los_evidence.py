"""What the powers of a link say about its line of sight: few numbers, so that few placements suffice to weigh them.

With a measured range, the received power and the power of the first path are held against what free space would give
(Friis): an obstacle costs decibels, a clear link of a building or gallery does not. Without one, the noise an
accumulated symbol is the level meter: it grows with the signal, and automatic gain does not compress it as it does the
power.
Decibels are squashed, since a deficit of ten says no more than one of four; weights cannot turn their sign.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from mine_loc_uwb.cir_input import SIDE_NAMES

Reals = NDArray[np.float64]
_MEDIAN = {name: len(SIDE_NAMES) + number for number, name in enumerate(SIDE_NAMES)}
POWER, FIRST_POWER, NOISE = (
    _MEDIAN[name]
    for name in (
        "receive_power_against_free_space_db",
        "first_path_power_against_free_space_db",
        "log_noise_per_symbol",
    )
)
"""Columns of side features with history: the medians over a link's last second."""
POWER_SCALE_DB, FIRST_SCALE_DB, FIRST_MIDDLE_DB = 2.0, 4.0, -6.0
NOISE_MIDDLE, NOISE_SCALE, NOISE_MOST = -1.5, 0.5, 2.5
"""Natural logarithm of counts a symbol: thermal noise lies at -2.2, receptions at the ceiling of power about -0.9."""
_RIDGE = 5e-4


@dataclass(frozen=True, slots=True)
class EvidenceWeights:
    """Logit of LOS = with_range · (power, first power, 1), or without a range without_range · (noise, 1)."""

    with_range: tuple[float, float, float]
    without_range: tuple[float, float]


def fit_evidence(side: Reals, los: NDArray[np.bool_], weight: Reals) -> EvidenceWeights:
    """Weights by monotone logistic regression with a small ridge.

    side: (n, 2 f) with history; weight: (n,) of the frames, sum 1. Frames that lack a feature are left out; with none
    left, or one kind alone, the weights are 0.
    """
    power = np.tanh(side[:, POWER] / POWER_SCALE_DB)
    first = np.tanh((side[:, FIRST_POWER] - FIRST_MIDDLE_DB) / FIRST_SCALE_DB)
    noise = np.clip((side[:, NOISE] - NOISE_MIDDLE) / NOISE_SCALE, -NOISE_MOST, NOISE_MOST)
    both = _fit(np.column_stack([power, first]), los, weight)
    alone = _fit(noise[:, None], los, weight)
    return EvidenceWeights((both[0], both[1], both[2]), (alone[0], alone[1]))


def _fit(features: Reals, los: NDArray[np.bool_], weight: Reals) -> list[float]:
    known = np.isfinite(features).all(axis=1)
    count = features.shape[1]
    if los[known].all() or not los[known].any():
        return [0.0] * (count + 1)
    design = np.column_stack([features[known], np.ones(known.sum())])
    sign, share = np.where(los[known], 1.0, -1.0), weight[known] / weight[known].sum()
    ridge = np.array([_RIDGE] * count + [0.0])

    def cost(w: Reals) -> tuple[float, Reals]:
        margin = sign * (design @ w)
        slope = -share * sign / (1.0 + np.exp(np.clip(margin, -50.0, 50.0)))
        return float(share @ np.logaddexp(0.0, -margin) + ridge @ w**2), slope @ design + 2.0 * ridge * w

    bounds = [(0.0, None)] * count + [(None, None)]
    found = minimize(cost, np.zeros(count + 1), jac=True, bounds=bounds, method="L-BFGS-B").x
    return [float(value) for value in found]
