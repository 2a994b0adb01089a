"""Which lines of a channel are of one emitter: every way to use each line once, and how probable each way is.

Two emitters on one channel give bearings that cross in false places, and two monitors alone cannot tell which are
false. So all ways to share the lines out among emitters are weighed. An emitter at x with lines S weighs

    λ ∫ Π_{i∈S} N(α_i; α_i(x), σ_i²) Π_{m∈S} D_m(x) Π_{m∉S} (1 − D_m(x)) dx

with λ the density of emitters on a channel and D_m the probability that monitor m hears it in the window; the integral
is Laplace's for two lines and more, and runs along the line for one. A way weighs the product of its emitters (the
association likelihood of multiple hypothesis tracking, Reid 1979, with a Poisson field of emitters). What a place
weighs in all ways together is the probability that somebody is there.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mine_loc_coarse.coverage import Coverage
from mine_loc_core.gates import chi2_quantile

Array = NDArray[np.float64]
_CONSISTENT = 0.9999
_MOST_CANDIDATES = 400
_MOST_WAYS = 5000
_SAME_PLACE = chi2_quantile(0.999, 2)
_LEAST_PROBABILITY = 0.01
_BEYOND_NOTICE = 9.0
"""Ways that are e^9 times less probable than the best one are left out."""


@dataclass(frozen=True, slots=True)
class Line:
    """A bearing line as plain numbers: index of its monitor, yaw [rad], variance [rad²], number of reports."""

    number: int
    monitor: int
    azimuth_rad: float
    variance_rad2: float
    count: int


@dataclass(frozen=True, slots=True)
class Candidate:
    """Lines that may be of one emitter, and where: the logarithm of the weight, and the probability of the place."""

    lines: frozenset[int]
    position_m: tuple[float, float]
    covariance_m2: tuple[float, float, float]
    log_weight: float
    probability: float = 1.0


def fitted(lines: Sequence[Line], place_m: Array, start_m: tuple[float, float]) -> tuple[Candidate, float]:
    """Weighted least squares of `lines`, the distances taken from `start_m`: where, and χ². Its weight is not set.

    Each line gives its distance from the point, over R σ, which is linear in the point.
    """
    xx = xy = yy = bx = by = c = 0.0
    for line in lines:
        px, py = place_m[line.monitor]
        nx, ny = -math.sin(line.azimuth_rad), math.cos(line.azimuth_rad)
        weight = 1.0 / (((start_m[0] - px) ** 2 + (start_m[1] - py) ** 2) * line.variance_rad2 + 1e-6)
        off = nx * px + ny * py
        xx, xy, yy = xx + weight * nx * nx, xy + weight * nx * ny, yy + weight * ny * ny
        bx, by, c = bx + weight * nx * off, by + weight * ny * off, c + weight * off * off
    determinant = max(xx * yy - xy * xy, 1e-12 * xx * yy + 1e-300)
    x, y = (yy * bx - xy * by) / determinant, (xx * by - xy * bx) / determinant
    chi2 = max(c - x * bx - y * by, 0.0)
    covariance = (yy / determinant, -xy / determinant, xx / determinant)
    return Candidate(frozenset(line.number for line in lines), (x, y), covariance, 0.0), chi2


@dataclass(frozen=True, slots=True)
class Pairing:
    """The emitters of the most probable way that have two lines or more, and the rivals of those that are not sure.

    `stated` have a probability of `stated_probability` or more, `ambiguous` less.
    """

    stated: tuple[Candidate, ...]
    ambiguous: tuple[Candidate, ...]


class Pairer:
    """Weighs the ways of one channel. `density_per_m2` is λ."""

    def __init__(self, coverage: Coverage, stated_probability: float) -> None:
        self._coverage = coverage
        self._place_m = coverage.place_m
        self._stated_probability = stated_probability

    def pair(
        self,
        lines: Sequence[Line],
        crossings: Sequence[tuple[int, int, tuple[float, float]]],
        density_per_m2: float,
        known: Sequence[tuple[tuple[float, float], tuple[float, float, float]]] = (),
    ) -> Pairing:
        """Pair `lines` that meet in `crossings` (numbers of two lines, position [m]).

        `known` are positions and covariances of emitters that were stated before this window began: an emitter where
        one of them is expected needs no new emitter, which is how history decides.
        """
        scans = float(max(line.count for line in lines))
        log_density = math.log(density_per_m2)
        candidates = self._candidates(lines, crossings, scans, log_density, known)
        for line in lines:
            area = self._coverage.single_m2(line.monitor, line.azimuth_rad, scans)
            weight = log_density + math.log(max(area, 1e-9))
            candidates.append(Candidate(frozenset([line.number]), (math.nan, math.nan), (0.0, 0.0, 0.0), weight))
        ways = _ways([line.number for line in lines], candidates)
        return self._judged(candidates, ways)

    def _candidates(
        self,
        lines: Sequence[Line],
        crossings: Sequence[tuple[int, int, tuple[float, float]]],
        scans: float,
        log_density: float,
        known: Sequence[tuple[tuple[float, float], tuple[float, float, float]]],
    ) -> list[Candidate]:
        """Every consistent set of two lines and more, grown from the crossings line by line."""
        by_number = {line.number: line for line in lines}
        sets: dict[frozenset[int], tuple[Candidate, float]] = {}
        growing = []
        for i, j, position_m in crossings:
            sets[frozenset((i, j))] = fitted((by_number[i], by_number[j]), self._place_m, position_m)
            growing.append(frozenset((i, j)))
        while growing and len(sets) < _MOST_CANDIDATES:
            base = growing.pop(0)
            members = [by_number[number] for number in base]
            heard_by = {line.monitor for line in members}
            for line in lines:
                larger = base | {line.number}
                if line.monitor in heard_by or larger in sets:
                    continue
                grown, chi2 = fitted((*members, line), self._place_m, sets[base][0].position_m)
                if chi2 <= chi2_quantile(_CONSISTENT, 2 * (len(larger) - 2)):
                    sets[larger] = (grown, chi2)
                    growing.append(larger)
        return self._weighed([*sets.values()], by_number, scans, log_density, known)

    def _weighed(
        self,
        found: Sequence[tuple[Candidate, float]],
        by_number: dict[int, Line],
        scans: float,
        log_density: float,
        known: Sequence[tuple[tuple[float, float], tuple[float, float, float]]],
    ) -> list[Candidate]:
        if not found:
            return []
        position_m = np.array([candidate.position_m for candidate, _ in found])
        sd_m = np.sqrt([candidate.covariance_m2[0] + candidate.covariance_m2[2] for candidate, _ in found])
        missed = self._coverage.missed(position_m, np.full(len(found), scans), sd_m)
        weighed = []
        for (candidate, chi2), silent in zip(found, missed.tolist(), strict=True):
            members = [by_number[number] for number in candidate.lines]
            for line in members:
                silent[line.monitor] = 1.0 - silent[line.monitor]
            a, b, d = candidate.covariance_m2
            weight = math.log(2.0 * math.pi) + 0.5 * math.log(max(a * d - b * b, 1e-300)) - chi2 / 2.0
            weight -= sum(0.5 * math.log(2.0 * math.pi * line.variance_rad2) for line in members)
            weight += sum(math.log(max(each, 1e-12)) for each in silent)
            weight += _log_presence(candidate, log_density, known)
            weighed.append(Candidate(candidate.lines, candidate.position_m, candidate.covariance_m2, weight))
        return weighed

    def _judged(self, candidates: list[Candidate], ways: list[tuple[float, tuple[int, ...]]]) -> Pairing:
        highest = max(weight for weight, _ in ways)
        shares = np.exp([weight - highest for weight, _ in ways])
        shares /= shares.sum()
        emitters = [
            [candidates[number] for number in members if len(candidates[number].lines) > 1] for _, members in ways
        ]
        stated: list[Candidate] = []
        ambiguous: list[Candidate] = []
        for way in np.argsort(-shares):
            if shares[way] < _LEAST_PROBABILITY:
                break
            for candidate in emitters[way]:
                # In the most probable way two emitters may well be in one place, on different lines.
                another = way == np.argmax(shares) and all(candidate.lines.isdisjoint(other.lines) for other in stated)
                if not another and any(_same_place(candidate, other) for other in (*stated, *ambiguous)):
                    continue
                here = [any(_same_place(candidate, other) for other in each) for each in emitters]
                probability = float(shares[here].sum())
                judged = Candidate(
                    candidate.lines, candidate.position_m, candidate.covariance_m2, candidate.log_weight, probability
                )
                (stated if probability >= self._stated_probability else ambiguous).append(judged)
        return Pairing(tuple(stated), tuple(ambiguous))


def _log_presence(
    candidate: Candidate,
    log_density: float,
    known: Sequence[tuple[tuple[float, float], tuple[float, float, float]]],
) -> float:
    """Logarithm of the density of emitters where the candidate is: λ, and more where one is known to be."""
    density = math.exp(log_density)
    for position_m, covariance_m2 in known:
        total = tuple(one + two for one, two in zip(candidate.covariance_m2, covariance_m2, strict=True))
        distance, determinant = _squared_distance(candidate.position_m, position_m, total)
        density += math.exp(-distance / 2.0) / (2.0 * math.pi * math.sqrt(determinant))
    return math.log(density)


def _same_place(one: Candidate, two: Candidate) -> bool:
    total = tuple(a + b for a, b in zip(one.covariance_m2, two.covariance_m2, strict=True))
    return _squared_distance(one.position_m, two.position_m, total)[0] <= _SAME_PLACE


def _squared_distance(
    one: tuple[float, float], two: tuple[float, float], covariance: tuple[float, ...]
) -> tuple[float, float]:
    """Mahalanobis' distance squared, and the determinant of the covariance."""
    a, b, d = covariance
    x, y = one[0] - two[0], one[1] - two[1]
    determinant = max(a * d - b * b, 1e-12 * a * d + 1e-300)
    return max((d * x * x - 2.0 * b * x * y + a * y * y) / determinant, 0.0), determinant


def _ways(numbers: Sequence[int], candidates: Sequence[Candidate]) -> list[tuple[float, tuple[int, ...]]]:
    """The ways to use each line once, with their weights, but those that the best one outweighs beyond notice.

    Branch and bound: no way weighs more than the sum of the best shares that its lines can have.
    """
    bit = {number: 1 << place for place, number in enumerate(numbers)}
    masks = [sum(bit[number] for number in candidate.lines) for candidate in candidates]
    weights = [candidate.log_weight for candidate in candidates]
    shares = [candidate.log_weight / len(candidate.lines) for candidate in candidates]
    by_share = sorted(range(len(candidates)), key=lambda index: -shares[index])
    holding = {each: [index for index in by_share if masks[index] & each] for each in bit.values()}
    best_share = {each: shares[holding[each][0]] for each in bit.values()}
    ways: list[tuple[float, tuple[int, ...]]] = []
    best = -math.inf

    def share_out(left: int, weight: float, bound: float, members: tuple[int, ...]) -> None:
        nonlocal best
        if not left:
            ways.append((weight, members))
            best = max(best, weight)
            return
        for index in holding[left & -left]:
            mask = masks[index]
            if mask & ~left:
                continue
            rest = bound - sum(best_share[each] for each in bit.values() if mask & each)
            if weight + weights[index] + rest < best - _BEYOND_NOTICE or len(ways) >= _MOST_WAYS:
                continue
            share_out(left & ~mask, weight + weights[index], rest, (*members, index))

    share_out((1 << len(numbers)) - 1, 0.0, sum(best_share.values()), ())
    return [way for way in ways if way[0] >= best - _BEYOND_NOTICE]
