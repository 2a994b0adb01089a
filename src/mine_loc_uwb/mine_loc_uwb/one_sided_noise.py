"""The error of a UWB range: Gaussian in line of sight, Gaussian plus an exponential excess out of it.

A wave that is obstructed arrives late, practically never early (no error below −0.35 m in three buildings, hardware
notes D.1), so the law is one-sided: a range that is too short is as wrong as it looks, one that is too long is not.
"""

import math

from numba import njit

_ROOT_2 = math.sqrt(2.0)
_ROOT_2_PI = math.sqrt(2.0 * math.pi)
_ROOT_PI = math.sqrt(math.pi)
_FARTHEST = 26.0  # erfc underflows beyond it


@njit(cache=True)
def normal_density(error_m: float, variance_m2: float) -> float:
    """Density [1/m] of a Gaussian of mean 0."""
    return math.exp(-0.5 * error_m * error_m / variance_m2) / (_ROOT_2_PI * math.sqrt(variance_m2))


@njit(cache=True)
def excess_density(error_m: float, variance_m2: float, scale_m: float) -> float:
    """Density [1/m] of a Gaussian of this variance plus an exponential excess of mean `scale_m`."""
    argument = (variance_m2 / scale_m - error_m) / math.sqrt(2.0 * variance_m2)
    if argument > _FARTHEST:  # a spread of many scales: the asymptotic series of erfc
        inverse_sq = 1.0 / (argument * argument)
        series = (1.0 - 0.5 * inverse_sq + 0.75 * inverse_sq * inverse_sq) / (_ROOT_PI * argument)
        return 0.5 / scale_m * math.exp(-0.5 * error_m * error_m / variance_m2) * series
    exponent = variance_m2 / (2.0 * scale_m * scale_m) - error_m / scale_m
    return 0.5 / scale_m * math.exp(exponent) * math.erfc(argument)


@njit(cache=True)
def score(
    error_m: float, variance_m2: float, nlos_probability: float, scale_m: float, outlier_density: float
) -> tuple[float, float, float]:
    """Score −(ln f)′ [1/m], information −(ln f)″ [1/m²] and P(NLOS | error) of an error under the mixture f.

    f = (1 − p) N(0, variance) + p (N ∗ Exp(scale)) + `outlier_density` [1/m], which bounds the pull of what neither
    explains. These are the terms of Masreliez' filter for non-Gaussian measurement noise (IEEE TAC 20:107, 1975).
    """
    p, slope = nlos_probability, -error_m / variance_m2
    gauss = normal_density(error_m, variance_m2)
    gauss_1, gauss_2 = slope * gauss, (slope * slope - 1.0 / variance_m2) * gauss
    excess = excess_density(error_m, variance_m2, scale_m)
    excess_1 = (gauss - excess) / scale_m
    excess_2 = (gauss_1 - excess_1) / scale_m
    f = (1.0 - p) * gauss + p * excess + outlier_density
    first = -((1.0 - p) * gauss_1 + p * excess_1) / f
    second = first * first - ((1.0 - p) * gauss_2 + p * excess_2) / f
    explained = (1.0 - p) * gauss + p * excess
    return first, second, p * excess / explained if explained > 0.0 else p


@njit(cache=True)
def deviance(error_m: float, variance_m2: float, nlos_probability: float, scale_m: float) -> float:
    """2 ln(f(0) / f(error)): the squared Mahalanobis distance where p = 0, and its like under the one-sided law.

    0 for errors that are likelier than none, as those are that an obstruction explains best.
    """
    p = nlos_probability
    at_zero = (1.0 - p) * normal_density(0.0, variance_m2) + p * excess_density(0.0, variance_m2, scale_m)
    here = (1.0 - p) * normal_density(error_m, variance_m2) + p * excess_density(error_m, variance_m2, scale_m)
    return max(2.0 * math.log(at_zero / here), 0.0) if here > 0.0 else math.inf
