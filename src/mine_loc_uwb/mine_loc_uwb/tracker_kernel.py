"""The arithmetic of `robust_tracker`: an extended Kalman filter over position, velocity and range biases.

State x: position (d,), velocity (d,), what all ranges of the tag have in common, what else the caller estimates, and
from `first_link` on the bias of each of L links. What is common covers the tag's own antenna delay; for the arrivals of
a blink it is their unknown offset. Ranges are taken one by one, each at its own instant, by the score of their
one-sided noise (`one_sided_noise`).
"""

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from mine_loc_uwb.fix import Array
from mine_loc_uwb.geometry import direction
from mine_loc_uwb.one_sided_noise import deviance, score

Integers = npt.NDArray[np.int64]

(
    ACCELERATION,
    BIAS_SD,
    BIAS_TIME,
    COMMON_SD,
    COMMON_TIME,
    NLOS_SCALE,
    NLOS_GROWTH,
    NLOS_TIME,
    NLOS_SHARE,
    TOP_SPEED,
    LEVEL_1M,
    LEVEL_EXPONENT,
    LEVEL_SD,
    SYSTEMATIC_SD,
    JUDGEMENT_WEIGHT,
    SETTINGS,
) = range(16)
"""Places of the settings in the array `noise`, and how many they are."""

ACCEPTED, TOO_LONG, TOO_SHORT, IMPOSSIBLE, CONTESTED = range(5)
"""What became of a range."""

_OUTLIER_DENSITY_PER_M = 2e-4
_DB_PER_E = 10.0 / math.log(10.0)
_IMPOSSIBLE_SDS = 5.0


@njit(cache=True)
def predict(x: Array, P: Array, dimensions: int, first_link: int, gone_s: float, noise: Array) -> None:
    """White acceleration moves the person; biases return to 0 with their time constants (Gauss–Markov).

    The caller's own states stay.
    """
    d, size = dimensions, len(x)
    q = noise[ACCELERATION] * gone_s
    common = math.exp(-gone_s / noise[COMMON_TIME])
    link = math.exp(-gone_s / noise[BIAS_TIME])
    for i in range(d):
        x[i] += gone_s * x[d + i]
        for j in range(size):
            P[i, j] += gone_s * P[d + i, j]
    for i in range(d):
        for j in range(size):
            P[j, i] += gone_s * P[j, d + i]
        P[i, i] += q * gone_s * gone_s / 3.0
        P[i, d + i] += q * gone_s / 2.0
        P[d + i, i] += q * gone_s / 2.0
        P[d + i, d + i] += q
    for i in range(2 * d, size):
        if 2 * d < i < first_link:
            continue
        fade = common if i == 2 * d else link
        x[i] *= fade
        for j in range(size):
            P[i, j] *= fade
            P[j, i] *= fade
        deviation = noise[COMMON_SD] if i == 2 * d else noise[BIAS_SD]
        P[i, i] += deviation * deviation * (1.0 - fade * fade)


@njit(cache=True)
def open_offset(
    x: Array,
    P: Array,
    dimensions: int,
    first_link: int,
    anchor_m: Array,
    slot: int,
    arrival_m: float,
    variance_m2: float,
    since_s: float,
    height_m: float,
    nlos_probability: float,
    nlos_scale_m: float,
    work: Array,
) -> None:
    """Take the offset of a new blink from one arrival: all that is known of it is that arrival minus its distance.

    An excess of probability p and mean s has mean p s and variance p (2 - p) s².
    """
    d, size, common, bias = dimensions, len(x), 2 * dimensions, first_link + slot
    at, unit, free = work[0], work[1], work[2]
    for axis in range(d):
        at[axis] = x[axis] + since_s * x[d + axis]
    distance = direction(at[:d], anchor_m, height_m, unit[:d])
    P[common, :] = 0.0
    P[:, common] = 0.0
    for i in range(size):
        free[i] = P[i, bias]
        for axis in range(d):
            free[i] += unit[axis] * (P[i, axis] + since_s * P[i, d + axis])
    p = nlos_probability
    variance = variance_m2 + p * (2.0 - p) * nlos_scale_m * nlos_scale_m + free[bias]
    for axis in range(d):
        variance += unit[axis] * (free[axis] + since_s * free[d + axis])
    x[common] = arrival_m - distance - x[bias] - p * nlos_scale_m
    for i in range(size):
        P[common, i] = -free[i]
        P[i, common] = -free[i]
    P[common, common] = variance


@njit(cache=True)
def take_range(
    x: Array,
    P: Array,
    dimensions: int,
    first_link: int,
    anchor_m: Array,
    slot: int,
    range_m: float,
    variance_m2: float,
    since_s: float,
    height_m: float,
    nlos_probability: float,
    nlos_scale_m: float,
    fresh: float,
    reach_m: float,
    gate: float,
    work: Array,
) -> tuple[int, float, float]:
    """Update (x, P) by one range; returns what became of it, its deviance and P(NLOS | range).

    `nlos_probability` is the belief before. The distance's curvature over the spread of the position is allowed for to
    second order, because people pass anchors closely. `reach_m` is how far the person can have come since the last
    fix. An excess that lasts is no new witness each time: it counts by the share `fresh` of its time that has gone.
    `work` is (3, size) of scratch.
    """
    d, size, common, bias = dimensions, len(x), 2 * dimensions, first_link + slot
    at, unit, gain = work[0], work[1], work[2]
    for axis in range(d):
        at[axis] = x[axis] + since_s * x[d + axis]
    distance = direction(at[:d], anchor_m, height_m, unit[:d])
    along = spread = 0.0
    for i in range(size):
        gain[i] = P[i, common] + P[i, bias]
        for axis in range(d):
            gain[i] += unit[axis] * (P[i, axis] + since_s * P[i, d + axis])
    for axis in range(d):
        for other in range(d):
            along += unit[axis] * unit[other] * P[axis, other]
        spread += P[axis, axis]
    curvature = math.sqrt(distance * distance + max(spread - along, 0.0)) - distance
    variance = gain[common] + gain[bias] + 2.0 * curvature * curvature + variance_m2
    for axis in range(d):
        variance += unit[axis] * (gain[axis] + since_s * gain[d + axis])
    error = range_m - distance - curvature - x[common] - x[bias]
    distance_sq = deviance(error, variance, nlos_probability, nlos_scale_m)
    if distance_sq > gate:
        impossible = error < -(reach_m + _IMPOSSIBLE_SDS * math.sqrt(variance))
        refused = TOO_LONG if error > 0.0 else IMPOSSIBLE if impossible else TOO_SHORT
        return refused, distance_sq, nlos_probability
    first, second, nlos = score(error, variance, nlos_probability, nlos_scale_m, _OUTLIER_DENSITY_PER_M)
    witness = 1.0 - nlos * (1.0 - fresh)
    first, second = witness * first, witness * min(max(second, 0.0), 1.0 / variance)
    for i in range(size):
        x[i] += first * gain[i]
        for j in range(i + 1):  # mirrored, because rounding that is not would grow with the square of time
            P[i, j] -= second * gain[i] * gain[j]
            P[j, i] = P[i, j]
    return ACCEPTED, distance_sq, nlos


@njit(cache=True)
def take_level(
    x: Array,
    P: Array,
    dimensions: int,
    anchor_m: Array,
    level_dbm: float,
    height_m: float,
    noise: Array,
    work: Array,
) -> None:
    """Update (x, P) by the level of one link: log-distance path loss with normal errors [dB] (paper D)."""
    d, size = dimensions, len(x)
    unit, gain = work[1], work[2]
    distance = direction(x[:d], anchor_m, height_m, unit[:d])
    slope = -_DB_PER_E * noise[LEVEL_EXPONENT] / distance
    variance = noise[LEVEL_SD] * noise[LEVEL_SD]
    for i in range(size):
        gain[i] = 0.0
        for axis in range(d):
            gain[i] += slope * unit[axis] * P[i, axis]
    for axis in range(d):
        variance += slope * unit[axis] * gain[axis]
    error = level_dbm - noise[LEVEL_1M] + _DB_PER_E * noise[LEVEL_EXPONENT] * math.log(distance)
    for i in range(size):
        x[i] += gain[i] * error / variance
        for j in range(size):
            P[i, j] -= gain[i] * gain[j] / variance
