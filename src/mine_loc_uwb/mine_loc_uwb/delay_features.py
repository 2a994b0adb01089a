"""Delay and amplitude features of power-delay profiles, the ones that papers on NLOS identification use.

Mean excess delay, RMS delay spread, kurtosis and rise time as in paper A's feature list and hardware.md D.2.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.floating]
NAMES = ("mean_excess", "rms_spread", "peak_delay", "kurtosis", "rise_time", "early_share", "early_db", "peak_to_noise")
_AHEAD = 2  # the pulse begins before half of its height
_EARLY = 4


@njit(cache=True)
def delay_features(window: Floats, before: int, offset: Floats, noise: Floats) -> Floats:
    """Features (n, 8), named by `NAMES`: logarithms of delays in taps, shares and decibels.

    window: (n, taps), |z| in counts, whose tap `before` is floor(first path); offset: (n,), delay of the window's first
    tap after the first path, taps; noise: (n,) rms |z| of noise, counts.
    """
    features = np.empty((len(window), 8))
    for number in range(len(window)):
        row = window[number].astype(np.float64)
        peak = row.max()
        energy, mean, spread = _delays(row, before, noise[number])
        early = energy[before - _AHEAD : before + _EARLY].sum() / max(energy.sum(), 1.0)
        features[number, 0] = math.log(max(mean, 0.3))
        features[number, 1] = math.log(max(spread, 0.3))
        features[number, 2] = math.log1p(max(offset[number] + row.argmax(), 0.0))
        features[number, 3] = math.log(_kurtosis(row) + 1e-6)
        features[number, 4] = math.log1p(max(offset[number] + (row > 0.9 * peak).argmax(), 0.0))
        features[number, 5] = early
        features[number, 6] = 10.0 * math.log10(early + 1e-3)
        features[number, 7] = 20.0 * math.log10(peak / noise[number]) if peak > 0.0 else -math.inf
    return features


@njit(cache=True)
def _delays(row: Floats, before: int, noise: float) -> tuple[Floats, float, float]:
    """Energy above the noise from the pulse on, its mean delay and the spread of that, taps."""
    energy = np.zeros(len(row))
    first = second = 0.0
    for tap in range(before - _AHEAD, len(row)):
        if row[tap] > 3.0 * noise:
            energy[tap] = row[tap] ** 2 - noise**2
            first += energy[tap] * (tap - before)
            second += energy[tap] * (tap - before) ** 2
    total = max(energy.sum(), 1.0)
    mean = first / total
    return energy, mean, math.sqrt(max(second / total - mean * mean, 0.0))


@njit(cache=True)
def _kurtosis(row: Floats) -> float:
    squared = (row - row.mean()) ** 2
    return float((squared * squared).mean() / max(squared.mean() ** 2, 1e-6))
