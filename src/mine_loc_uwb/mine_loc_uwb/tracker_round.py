"""A round of `robust_tracker`: in which order ranges are taken, what is believed of links, what may be claimed."""

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from mine_loc_uwb.fix import Array
from mine_loc_uwb.geometry import direction, gdop, inverse_information
from mine_loc_uwb.tracker_kernel import (
    ACCEPTED,
    CONTESTED,
    IMPOSSIBLE,
    JUDGEMENT_WEIGHT,
    LEVEL_SD,
    NLOS_GROWTH,
    NLOS_SCALE,
    NLOS_SHARE,
    NLOS_TIME,
    SYSTEMATIC_SD,
    TOO_SHORT,
    TOP_SPEED,
    Integers,
    open_offset,
    predict,
    take_level,
    take_range,
)

USED, RESIDUAL_RMS, GDOP, SHORT, HOLDING, QUALITIES = range(6)
"""Places in `quality`: ranges used, their RMS difference from the new state [m], their dilution of precision, ranges
that are too short, and ranges that hold the place, within three deviations of it."""

_WEAK_DBM, _LEAST_SCALE_M, _MOST_SCALE_M = -92.0, 0.05, 10.0
_LEAST_NLOS, _MOST_NLOS = 0.01, 0.97
_CONTEST = 3
_HOLDING_DEVIANCE = 9.0
_MOST_SYSTEMATIC_M2 = 5.0**2


@njit(cache=True)
def take_round(
    x: Array,
    P: Array,
    dimensions: int,
    first_link: int,
    anchors_m: Array,
    slots: Integers,
    range_m: Array,
    variance_m2: Array,
    since_s: Array,
    height_m: float,
    los_probability: Array,
    level_dbm: Array,
    link_nlos: Array,
    ahead_s: float,
    gone_s: float,
    offset_unknown: int,
    gate: float,
    noise: Array,
    codes: Integers,
    deviances: Array,
    quality: Array,
    claimed_m2: Array,
) -> None:
    """Take all ranges of a round, `gone_s` after the last one, into a state that is to be predicted to it by `ahead_s`.

    What fits best is taken first, so that it decides what becomes of the rest. `link_nlos` (L,) is how far each link is
    believed to be obstructed by its own ranges; belief fades to the share of links that are. A judgement of the link
    given beside the range (`los_probability`, at even odds) shifts it. `offset_unknown` = 1 says that the ranges are
    arrivals with an unknown offset. Of three or more ranges half must be believed, or none is: a few that are wrong
    alike would drag the track. Leaves in `codes` and `deviances` (n,) what became of each range, in `quality` how good
    the round was, in `claimed_m2` (3, 3), zeros before, the covariance to claim.
    """
    if ahead_s > 0.0:
        predict(x, P, dimensions, first_link, ahead_s, noise)
    work = np.empty((3, len(x)))
    x_before, P_before, nlos_before = x.copy(), P.copy(), link_nlos.copy()
    fresh = min(gone_s / noise[NLOS_TIME], 1.0)
    memory, share, weight = math.exp(-gone_s / noise[NLOS_TIME]), noise[NLOS_SHARE], noise[JUDGEMENT_WEIGHT]
    for slot in range(len(link_nlos)):  # of all links, heard or not
        link_nlos[slot] = share + memory * (link_nlos[slot] - share)
    todo = np.ones(len(range_m), np.bool_)
    if offset_unknown > 0:
        first = _surest(level_dbm, noise)
        todo[first] = False
        slot = slots[first]
        belief = _shifted(link_nlos[slot], los_probability[first], weight)
        codes[first], deviances[first] = ACCEPTED, 0.0
        open_offset(
            x, P, dimensions, first_link, anchors_m[first], slot, range_m[first], variance_m2[first], since_s[first],
            height_m, belief, _scale_m(level_dbm[first], noise), work,
        )  # fmt: skip
    for _ in range(todo.sum()):
        number = _most_credible(x, dimensions, first_link, anchors_m, slots, range_m, height_m, todo, work)
        todo[number] = False
        slot = slots[number]
        belief = _shifted(link_nlos[slot], los_probability[number], weight)
        codes[number], deviances[number], nlos = take_range(
            x, P, dimensions, first_link, anchors_m[number], slot, range_m[number], variance_m2[number],
            since_s[number], height_m, belief, _scale_m(level_dbm[number], noise), fresh,
            gone_s * noise[TOP_SPEED], gate, work,
        )  # fmt: skip
        link_nlos[slot] = _shifted(nlos, 1.0 - los_probability[number], weight)  # the judgement taken out again
    if noise[LEVEL_SD] > 0.0:
        for number in range(len(range_m)):
            if codes[number] == ACCEPTED and not math.isnan(level_dbm[number]):
                take_level(x, P, dimensions, anchors_m[number], level_dbm[number], height_m, noise, work)
    if len(codes) >= _CONTEST and 2 * np.sum(codes == ACCEPTED) < len(codes):
        x[:], P[:], link_nlos[:] = x_before, P_before, nlos_before
        codes[codes == ACCEPTED] = CONTESTED
    judge_round(x, dimensions, first_link, anchors_m, slots, range_m, since_s, height_m, codes, deviances, quality)
    claim(x, P, dimensions, anchors_m, height_m, codes, noise, claimed_m2)


@njit(cache=True)
def judge_round(
    x: Array,
    dimensions: int,
    first_link: int,
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
        squares += (range_m[number] - distance - x[2 * d] - x[first_link + slots[number]]) ** 2
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
def _shifted(belief: float, los_probability: float, weight: float) -> float:
    """Belief in an obstruction after a judgement of the link whose odds count by `weight`; NaN = there is none."""
    if not math.isnan(los_probability):
        against = belief * (1.0 - los_probability) ** weight
        belief = against / (against + (1.0 - belief) * los_probability**weight)
    return min(max(belief, _LEAST_NLOS), _MOST_NLOS)


@njit(cache=True)
def _most_credible(
    x: Array,
    dimensions: int,
    first_link: int,
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
            error = abs(range_m[number] - distance - x[2 * dimensions] - x[first_link + slots[number]])
            if error <= least:
                best, least = number, error
    return best
