"""Whether an estimator is as sure as it may be: NEES, and intervals that allow for errors that follow each other.

Errors of one track are alike from one output to the next, so that n of them say less than n independent ones would.
How many they are worth is found from their autocorrelation.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mine_loc_core.gates import chi2_quantile

Array = npt.NDArray[np.float64]
_NORMAL_95 = 1.959964


@dataclass(frozen=True, slots=True)
class Interval:
    """Both ends of a 95 % interval."""

    low: float
    high: float


def nees(error_m: Array, covariance_m2: Array) -> Array:
    """Normalised squared errors eᵀ P⁻¹ e (n,) of errors (n, d) with covariances (n, d, d).

    NaN where a covariance is not positive definite. Bar-Shalom, Li and Kirubarajan, Estimation with Applications to
    Tracking and Navigation, section 5.4.2.
    """
    found = np.full(len(error_m), np.nan)
    finite = np.isfinite(error_m).all(axis=1) & np.isfinite(covariance_m2).all(axis=(1, 2))
    definite = np.flatnonzero(finite)
    definite = definite[np.linalg.eigvalsh(covariance_m2[definite])[:, 0] > 0.0]
    e = error_m[definite]
    found[definite] = np.einsum("ni,ni->n", e, np.linalg.solve(covariance_m2[definite], e[:, :, None])[:, :, 0])
    return found


def consistent_mean_nees(dimensions: int, independent: float) -> Interval:
    """Where the mean NEES of so many independent errors of an honest estimator lies with 95 % probability."""
    count = max(independent, 1.0)
    degrees = max(round(dimensions * count), 1)
    return Interval(*(chi2_quantile(p, degrees) / degrees * dimensions for p in (0.025, 0.975)))


def share_interval(share: float, independent: float) -> Interval:
    """Of a share found in so many independent trials (Wilson, J. Am. Stat. Assoc. 22, 1927)."""
    n, z2 = max(independent, 1.0), _NORMAL_95**2
    centre = (share + z2 / (2.0 * n)) / (1.0 + z2 / n)
    half = _NORMAL_95 / (1.0 + z2 / n) * math.sqrt(share * (1.0 - share) / n + z2 / (4.0 * n * n))
    return Interval(max(centre - half, 0.0), min(centre + half, 1.0))


def independent_count(values: Array) -> float:
    """How many independent values the mean of a series (n,) is worth, from 1 to n; a constant one is worth 1.

    By the sum of its autocorrelation over Geyer's initial positive sequence (Statistical Science 7, 1992).
    """
    count = len(values)
    off = values - values.mean() if count else values
    power = float(off @ off)
    if count < 4 or power <= 1e-18 * float(values @ values):
        return float(min(count, 1))
    spectrum = np.fft.rfft(off, 2 * count)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2)[: count - count % 2] / power
    pairs = correlation[0::2] + correlation[1::2]
    negative = np.flatnonzero(pairs <= 0.0)
    pairs = pairs[: negative[0]] if len(negative) else pairs
    return float(np.clip(count / max(2.0 * pairs.sum() - 1.0, 1e-9), 1.0, count))
