"""Delay and amplitude features of power-delay profiles, the ones that papers on NLOS identification use.

Mean excess delay, RMS delay spread, kurtosis and rise time as in paper A's feature list and hardware.md D.2.
"""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.floating]
NAMES = ("mean_excess", "rms_spread", "peak_delay", "kurtosis", "rise_time", "early_share", "early_db", "peak_to_noise")
_AHEAD = 2  # the pulse begins before half of its height
_EARLY = 4


def delay_features(window: Floats, before: int, offset: Floats, noise: Floats) -> Floats:
    """Features (n, 8), named by `NAMES`: logarithms of delays in taps, shares and decibels.

    window: (n, taps), |z| in counts, whose tap `before` is floor(first path); offset: (n,), delay of the window's first
    tap after the first path, taps; noise: (n,) rms |z| of noise, counts.
    """
    energy = np.where(window > 3.0 * noise[:, None], window**2 - noise[:, None] ** 2, 0.0)
    energy[:, : before - _AHEAD] = 0.0
    total = np.maximum(energy.sum(axis=1), 1.0)
    delay = np.arange(-before, window.shape[1] - before)
    mean = energy @ delay / total
    spread = np.sqrt(np.maximum(energy @ delay**2 / total - mean**2, 0.0))
    peak = window.max(axis=1)
    squared = (window - window.sum(axis=1, keepdims=True) / window.shape[1]) ** 2
    second = squared.sum(axis=1) / window.shape[1]
    fourth = (squared * squared).sum(axis=1) / window.shape[1]
    early = energy[:, before - _AHEAD : before + _EARLY].sum(axis=1) / total
    return np.column_stack(
        [
            np.log(np.maximum(mean, 0.3)),
            np.log(np.maximum(spread, 0.3)),
            np.log1p(np.maximum(offset + window.argmax(axis=1), 0.0)),
            np.log(fourth / np.maximum(second**2, 1e-6) + 1e-6),
            np.log1p(np.maximum(offset + (window > 0.9 * peak[:, None]).argmax(axis=1), 0.0)),
            early,
            10.0 * np.log10(early + 1e-3),
            20.0 * np.log10(peak / noise),
        ]
    )
