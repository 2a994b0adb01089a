"""The arithmetic of `robust_tracker`: an extended Kalman filter over position, velocity and range biases.

State x, of size 2d + 1 + L: position (d,), velocity (d,), what all ranges of the tag have in common, and the bias of
each of L links. The first covers the tag's own antenna delay; for the arrivals of a blink it is their unknown offset.
Ranges are taken one by one, each at its own instant, by the score of their one-sided noise (`one_sided_noise`).
"""

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from mine_loc_uwb.fix import Array
from mine_loc_uwb.geometry import direction, gdop, inverse_information
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
    SETTINGS,
) = range(15)
"""Places of the settings in the array `noise`, and how many they are."""

ACCEPTED, TOO_LONG, TOO_SHORT, IMPOSSIBLE, CONTESTED = range(5)
"""What became of a range."""

USED, RESIDUAL_RMS, GDOP, SHORT, HOLDING, QUALITIES = range(6)
"""Places in `quality`: ranges used, their RMS difference from the new state [m], their dilution of precision, ranges
that are too short, and ranges that hold the place, within three deviations of it."""

_OUTLIER_DENSITY_PER_M = 2e-4
_DB_PER_E = 10.0 / math.log(10.0)
_WEAK_DBM, _LEAST_SCALE_M, _MOST_SCALE_M = -92.0, 0.05, 10.0
_LEAST_NLOS, _MOST_NLOS = 0.01, 0.97
_IMPOSSIBLE_SDS = 5.0
_CONTEST = 3
_HOLDING_DEVIANCE = 9.0
_MOST_SYSTEMATIC_M2 = 5.0**2


@njit(cache=True)
def predict(x: Array, P: Array, dimensions: int, gone_s: float, noise: Array) -> None:
    """White acceleration moves the person; biases return to 0 with their time constants (Gauss–Markov)."""
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
    d, size, common, bias = dimensions, len(x), 2 * dimensions, 2 * dimensions + 1 + slot
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
    d, size, common, bias = dimensions, len(x), 2 * dimensions, 2 * dimensions + 1 + slot
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


@njit(cache=True)
def take_round(
    x: Array,
    P: Array,
    dimensions: int,
    anchors_m: Array,
    slots: Integers,
    range_m: Array,
    variance_m2: Array,
    since_s: Array,
    height_m: float,
    los_probability: Array,
    level_dbm: Array,
    link_nlos: Array,
    gone_s: float,
    offset_unknown: int,
    gate: float,
    noise: Array,
    codes: Integers,
    deviances: Array,
    quality: Array,
    claimed_m2: Array,
) -> None:
    """Predict by `gone_s` and take all ranges of a round.

    What fits best is taken first, so that it decides what becomes of the rest. `link_nlos` (L,) is how far each link is
    believed to be obstructed by its own ranges; belief fades to the share of links that are. A judgement of the link
    given beside the range (`los_probability`, at even odds) shifts it. `offset_unknown` = 1 says that the ranges are
    arrivals with an unknown offset. Of three or more ranges half must be believed, or none is: a few that are wrong
    alike would drag the track. Leaves in `codes` and `deviances` (n,) what became of each range, in `quality` how good
    the round was, in `claimed_m2` (3, 3), zeros before, the covariance to claim.
    """
    work = np.empty((3, len(x)))
    predict(x, P, dimensions, gone_s, noise)
    x_before, P_before, nlos_before = x.copy(), P.copy(), link_nlos.copy()
    fresh = min(gone_s / noise[NLOS_TIME], 1.0)
    memory, share = math.exp(-gone_s / noise[NLOS_TIME]), noise[NLOS_SHARE]
    for slot in range(len(link_nlos)):  # of all links, heard or not
        link_nlos[slot] = share + memory * (link_nlos[slot] - share)
    todo = np.ones(len(range_m), np.bool_)
    if offset_unknown > 0:
        first = _surest(level_dbm, noise)
        todo[first] = False
        slot = slots[first]
        belief = _shifted(link_nlos[slot], los_probability[first])
        codes[first], deviances[first] = ACCEPTED, 0.0
        open_offset(
            x, P, dimensions, anchors_m[first], slot, range_m[first], variance_m2[first], since_s[first], height_m,
            belief, _scale_m(level_dbm[first], noise), work,
        )  # fmt: skip
    for _ in range(todo.sum()):
        number = _most_credible(x, dimensions, anchors_m, slots, range_m, height_m, todo, work)
        todo[number] = False
        slot = slots[number]
        belief = _shifted(link_nlos[slot], los_probability[number])
        codes[number], deviances[number], nlos = take_range(
            x, P, dimensions, anchors_m[number], slot, range_m[number], variance_m2[number], since_s[number],
            height_m, belief, _scale_m(level_dbm[number], noise), fresh, gone_s * noise[TOP_SPEED], gate, work,
        )  # fmt: skip
        link_nlos[slot] = _shifted(nlos, 1.0 - los_probability[number])  # the judgement taken out again
    if noise[LEVEL_SD] > 0.0:
        for number in range(len(range_m)):
            if codes[number] == ACCEPTED and not math.isnan(level_dbm[number]):
                take_level(x, P, dimensions, anchors_m[number], level_dbm[number], height_m, noise, work)
    if len(codes) >= _CONTEST and 2 * np.sum(codes == ACCEPTED) < len(codes):
        x[:], P[:], link_nlos[:] = x_before, P_before, nlos_before
        codes[codes == ACCEPTED] = CONTESTED
    judge_round(x, dimensions, anchors_m, slots, range_m, since_s, height_m, codes, deviances, quality)
    claim(x, P, dimensions, anchors_m, height_m, codes, noise, claimed_m2)


@njit(cache=True)
def judge_round(
    x: Array,
    dimensions: int,
    anchors_m: Array,
    slots: Integers,
    range_m: Array,
    since_s: Array,
    height_m: float,
    codes: Integers,
    deviances: Array,
    quality: Array,
) -> None:
    """Leave in `quality` how good a round was, by what became of its ranges; NaN deviances hold nothing."""
    d = dimensions
    at, unit, used = np.empty(d), np.empty(d), np.zeros(len(range_m))
    quality[:], squares = 0.0, 0.0
    for number in range(len(range_m)):
        quality[SHORT] += codes[number] in (TOO_SHORT, IMPOSSIBLE)
        if codes[number] != ACCEPTED:
            continue
        for axis in range(d):
            at[axis] = x[axis] + since_s[number] * x[d + axis]
        distance = direction(at, anchors_m[number], height_m, unit)
        squares += (range_m[number] - distance - x[2 * d] - x[2 * d + 1 + slots[number]]) ** 2
        used[number] = 1.0
        quality[HOLDING] += deviances[number] < _HOLDING_DEVIANCE
    quality[USED] = used.sum()
    quality[RESIDUAL_RMS] = math.sqrt(squares / quality[USED]) if quality[USED] > 0.0 else math.nan
    quality[GDOP] = gdop(x[:d], anchors_m, used, height_m)


@njit(cache=True)
def claim(
    x: Array,
    P: Array,
    dimensions: int,
    anchors_m: Array,
    height_m: float,
    codes: Integers,
    noise: Array,
    claimed_m2: Array,
) -> None:
    """Covariance of the state, and what stays of each used link through the geometry, in `claimed_m2` (3, 3).

    Where the geometry says next to nothing of a direction, the state's own spread does: the latter part has a limit.
    """
    d = dimensions
    used, common = (codes == ACCEPTED).astype(np.float64), np.zeros((d, d))
    if inverse_information(x[:d], anchors_m, used, height_m, common):
        common *= noise[SYSTEMATIC_SD] * noise[SYSTEMATIC_SD]
        common *= min(1.0, _MOST_SYSTEMATIC_M2 / max(np.trace(common), 1e-12))
    else:
        common[:] = 0.0
    for i in range(d):
        for j in range(d):
            claimed_m2[i, j] = P[i, j] + common[i, j]


@njit(cache=True)
def _scale_m(level_dbm: float, noise: Array) -> float:
    """Mean excess of an obstructed link: the weaker it is, the later its slow edge passes the threshold."""
    scale_m = noise[NLOS_SCALE]
    if not math.isnan(level_dbm):
        scale_m *= math.exp(noise[NLOS_GROWTH] * (_WEAK_DBM - level_dbm))
    return float(min(max(scale_m, _LEAST_SCALE_M), _MOST_SCALE_M))


@njit(cache=True)
def _surest(level_dbm: Array, noise: Array) -> int:
    """The arrival whose excess is least uncertain, the first of equals."""
    best, least = 0, math.inf
    for number in range(len(level_dbm)):
        scale_m = _scale_m(level_dbm[number], noise)
        if scale_m < least:
            best, least = number, scale_m
    return best


@njit(cache=True)
def _shifted(belief: float, los_probability: float) -> float:
    """Belief in an obstruction after a judgement of the link; NaN = there is none."""
    if not math.isnan(los_probability):
        against = belief * (1.0 - los_probability)
        belief = against / (against + (1.0 - belief) * los_probability)
    return min(max(belief, _LEAST_NLOS), _MOST_NLOS)


@njit(cache=True)
def _most_credible(
    x: Array,
    dimensions: int,
    anchors_m: Array,
    slots: Integers,
    range_m: Array,
    height_m: float,
    todo: npt.NDArray[np.bool_],
    work: Array,
) -> int:
    """The range, of those still to do, that differs least from the prediction."""
    best, least = 0, math.inf
    for number in range(len(range_m)):
        if todo[number]:
            distance = direction(x[:dimensions], anchors_m[number], height_m, work[1, :dimensions])
            error = abs(range_m[number] - distance - x[2 * dimensions] - x[2 * dimensions + 1 + slots[number]])
            if error <= least:
                best, least = number, error
    return best
