"""Position from time differences and signal levels of one blink (paper D, eq. 1–6).

With the reference node at the origin and r_i = r_1 + d_i, squaring leaves equations linear in (p, r_1):
2 x_i·p + 2 d_i r_1 = K_i − d_i², K_i = |x_i|² + h_i² − h_1², where h is a node's height over a tag of known height,
else 0. Time differences of dimensions + 1 nodes leave r_1 open; r_1² = |p|² + h_1² closes them, with two roots. Levels
give further linear equations: r_1 itself and differences of r_i². Joined, weighted by propagated variances and held to
the closure, they give one place, from which a few steps lead to the likeliest; it has to beat the roots.
"""

from collections.abc import Sequence

import numpy as np

from mine_loc_core.gates import chi2_quantile
from mine_loc_core.verdicts import Reason
from mine_loc_uwb.blink_likelihood import Blink, TdoaRssParameters, Whereabouts
from mine_loc_uwb.fix import Array, Fix, FixStatus, no_fix
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.solver import Solution

_RANK_TOLERANCE = 1e-6
_REWEIGHTINGS, _PROJECTIONS, _DESCENTS = 3, 4, 6
_NEAR_ENOUGH_M = 0.01
_DECISIVE = 3.0
"""A place is taken when it is e^3 times as likely as any other: 95 % of an even bet."""
_CONTRADICTION = 0.9999
_WALKING_M_PER_S = 2.0
_MEMORY_S = 5.0


class TdoaRss:
    """Each blink by itself; the last fix only helps to choose between places as likely."""

    def __init__(self, parameters: TdoaRssParameters) -> None:
        self.parameters = parameters
        self._last: tuple[int, Fix] | None = None

    def solve(self, measurements: Measurements) -> Solution:
        """See `Solver.solve`."""
        fix, reason = solve_blink(measurements, self.parameters, self._whereabouts(measurements.stamp_ns))
        if fix.status is FixStatus.OK:
            self._last = measurements.stamp_ns, fix
        count = len(measurements)
        return Solution(fix, (reason,) * count, np.full(count, np.nan), np.nan)

    def _whereabouts(self, stamp_ns: int) -> Whereabouts | None:
        if self._last is None or not 0 <= (gone_s := 1e-9 * (stamp_ns - self._last[0])) <= _MEMORY_S:
            return None
        fix = self._last[1]
        return Whereabouts(fix.position_m, float(np.trace(fix.covariance_m2)) + (_WALKING_M_PER_S * gone_s) ** 2)


def solve_blink(
    measurements: Measurements, parameters: TdoaRssParameters, last: Whereabouts | None = None
) -> tuple[Fix, Reason]:
    """Position of one blink, or of one round of plain ranges, whose first range is then r_1 itself.

    Without a fix the reason says why: DEGENERATE also for too few nodes, AMBIGUOUS where two places are about as
    likely, INVALID where no place agrees with what was measured.
    """
    dimensions = 3 if measurements.height_m is None else 2
    count = len(measurements)
    if count < dimensions + 1:
        return no_fix(FixStatus.TOO_FEW_RANGES, dimensions), Reason.DEGENERATE
    blink = Blink.of(measurements, parameters, last, dimensions)
    spread = np.linalg.svd(blink.node_m[1:], compute_uv=False)
    if spread[-1] <= _RANK_TOLERANCE * max(1.0, spread[0]):
        return no_fix(FixStatus.DEGENERATE, dimensions), Reason.DEGENERATE
    places = [_polished(blink, _joined(blink))] if blink.has_range else []
    places += [place for place in _closed(blink) if not places or blink.apart(place, places[0])]
    if not places:
        return no_fix(FixStatus.DIVERGED, dimensions), Reason.INVALID
    best, decided = _choose(blink, places)
    if not decided:
        return no_fix(FixStatus.DEGENERATE, dimensions), Reason.AMBIGUOUS
    return _judge(blink, best, measurements, parameters.max_gdop)


def _closed(blink: Blink) -> list[Array]:
    """Places where time differences alone meet the closure, up to two; the nearest miss where there is none."""
    pick = np.linalg.pinv(blink.node_m[1:])
    start = pick @ (0.5 * (blink.constants[1:] - blink.later_m[1:] ** 2))
    along = -pick @ blink.later_m[1:]  # p = start + along r_1
    a, b, c = along @ along - 1.0, start @ along, start @ start + blink.over_m[0] ** 2
    if abs(a) < np.finfo(float).eps:
        roots = [-0.5 * c / b] if b != 0.0 else []
    else:
        root = np.sqrt(max(b * b - a * c, 0.0))
        roots = [(-b - root) / a, (-b + root) / a] if root > 0.0 else [-b / a]
    nearest = -float(blink.later_m.min())  # no range is negative
    return [start + along * first for first in roots if first >= nearest]


def _joined(blink: Blink) -> Array:
    """Solve the linear equations of time differences and ranges for (p, r_1), weighted and held to the closure."""
    ranges_m = np.full(len(blink.node_m), float(np.linalg.norm(blink.node_m, axis=1).mean()))
    known = np.array([])
    for _ in range(_REWEIGHTINGS):
        A, b, covariance = _equations(blink, ranges_m)
        weighted = np.linalg.solve(covariance, A).T
        spread = np.asarray(np.linalg.pinv(weighted @ A, hermitian=True), np.float64)
        known = _on_closure(spread @ (weighted @ b), spread, float(blink.over_m[0]))
        ranges_m = blink.ranges_m(known[:-1])
    return known[:-1]


def _polished(blink: Blink, place_m: Array) -> Array:
    """Descend to the likeliest place nearby: the equations linearised there, levels in dB, whose noise is normal."""
    cost = blink.cost(place_m)
    for _ in range(_DESCENTS):
        step = np.linalg.lstsq(blink.information(place_m), blink.ascent(place_m), rcond=None)[0]
        while (new_cost := blink.cost(place_m + step)) > cost and step @ step > _NEAR_ENOUGH_M**2:
            step = 0.5 * step
        if step @ step <= _NEAR_ENOUGH_M**2:
            break
        place_m, cost = place_m + step, new_cost
    return place_m


def _equations(blink: Blink, ranges_m: Array) -> tuple[Array, Array, Array]:
    """A (p, r_1) = b and the covariance of b, its weights taken at these ranges."""
    count, dimensions = blink.node_m.shape
    later, K = blink.later_m, blink.constants
    A = [np.column_stack([2.0 * blink.node_m[1:], 2.0 * later[1:]])]
    b = [K[1:] - later[1:] ** 2]
    by_arrival = [np.column_stack([2.0 * ranges_m[1:], np.diag(-2.0 * ranges_m[1:])])]
    by_level = [np.zeros((count - 1, count))]
    only_first = np.append(np.zeros(dimensions), 1.0)[None]
    unit = np.eye(count)
    if np.isfinite(blink.first_m):
        A, b = [*A, only_first], [*b, np.array([blink.first_m])]
        by_arrival, by_level = [*by_arrival, unit[:1]], [*by_level, np.zeros((1, count))]
    heard = np.flatnonzero(np.isfinite(blink.level_dbm))
    if blink.path_loss is not None and len(heard):
        j, others = heard[0], heard[1:]
        r_m, share = blink.path_loss.power_of_range(blink.level_dbm, 1)
        r2_m2, share2 = blink.path_loss.power_of_range(blink.level_dbm, 2)
        A += [only_first, np.column_stack([2.0 * (blink.node_m[others] - blink.node_m[j]), np.zeros(len(others))])]
        b += [np.array([r_m[j] - later[j]]), K[others] - K[j] - r2_m2[others] + r2_m2[j]]
        by_arrival += [(unit[0] - unit[j])[None], np.zeros((len(others), count))]
        squares = share2 * ranges_m**2
        by_level += [share * ranges_m[j] * unit[[j]], squares[j] * unit[[j]] - squares[others, None] * unit[others]]
    over_arrivals, over_levels = np.concatenate(by_arrival), np.concatenate(by_level)
    covariance = (
        over_arrivals * blink.variance_m2
    ) @ over_arrivals.T + over_levels @ over_levels.T / blink.level_weight
    return np.concatenate(A), np.concatenate(b), covariance


def _on_closure(free: Array, spread: Array, over_m: float) -> Array:
    """Likeliest (p, r_1) with r_1² = |p|² + h_1², given that without it, (d + 1,), and its covariance."""
    known = free.copy()
    for _ in range(_PROJECTIONS):
        slope = 2.0 * np.append(-known[:-1], known[-1])
        miss = known[-1] ** 2 - known[:-1] @ known[:-1] - over_m**2 + slope @ (free - known)
        across = spread @ slope
        known = free - across * (miss / max(float(slope @ across), np.finfo(float).tiny))
    return known


def _choose(blink: Blink, places: Sequence[Array]) -> tuple[Array, bool]:
    """Take the likeliest place, and say whether it is decidedly so."""
    ranked = sorted(places, key=blink.surprise)
    others = [place for place in ranked[1:] if blink.apart(place, ranked[0])]
    return ranked[0], not others or blink.surprise(others[0]) - blink.surprise(ranked[0]) > _DECISIVE


def _judge(blink: Blink, place_m: Array, measurements: Measurements, max_gdop: float) -> tuple[Fix, Reason]:
    """Geometry and contradiction at the place."""
    count, dimensions = blink.node_m.shape
    information = blink.information(place_m)
    if np.linalg.cond(information) > 1.0 / np.finfo(float).eps:
        return no_fix(FixStatus.DEGENERATE, dimensions), Reason.DEGENERATE
    solved = np.linalg.inv(information)
    gdop = float(np.sqrt(np.trace(solved) / blink.variance_m2.mean()))
    redundancy = max(count - dimensions - (1 if measurements.shared_offset else 0), 1)
    if blink.contradiction(place_m) > chi2_quantile(_CONTRADICTION, redundancy):
        return no_fix(FixStatus.DIVERGED, dimensions, gdop), Reason.INVALID
    if gdop > max_gdop:
        return no_fix(FixStatus.DEGENERATE, dimensions, gdop), Reason.DEGENERATE
    residual = blink.residual_m(place_m)
    residual -= residual.mean() if measurements.shared_offset else 0.0
    position_m, covariance = measurements.anchors_m[0].copy(), np.zeros((3, 3))
    position_m[:dimensions] += place_m
    covariance[:dimensions, :dimensions] = 0.5 * (solved + solved.T)
    if measurements.height_m is not None:
        position_m[2] = measurements.height_m
    fix = Fix(FixStatus.OK, position_m, covariance, dimensions, count, float(np.sqrt(np.mean(residual**2))), gdop)
    return fix, Reason.ACCEPTED
