"""Ranges without accumulators, by a law that this code learns from the accumulators.

Receptions are simulated over a grid of distance, loss and way round; each cell keeps their errors in order, with the
class and powers that came with each. A link then walks through its cell's errors by a slowly varying rank, so that
spread, skewness, losses and correlation along a way are those of the full level. No number here is set by hand.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from mine_loc_sim import radio_constants as constants
from mine_loc_sim.gauss_markov import GaussMarkov
from mine_loc_sim.link_channel import LinkChannel, Obstruction
from mine_loc_sim.mine import LinkGeometry
from mine_loc_sim.radio_constants import Environment
from mine_loc_sim.range_bias import level_bias_m
from mine_loc_sim.ranging_link import (
    Exchanges,
    Indices,
    Radios,
    Ranges,
    Reals,
    Whereabouts,
    early_false_paths_m,
    exchange,
    obstruction,
    off_facing,
)
from mine_loc_sim.wearer import Wearer, body_process

_DISTANCE_M = np.array([1.0, 2.5, 6.0, 15.0, 35.0, 80.0])
_LOSS_DB = np.array([5.0, 10.0, 18.0, 30.0, 60.0])
_DETOUR_M = np.array([0.0, 0.1, 0.5, 2.0, 8.0])
_SCATTERED_SLOPE_DB = 10.0 * constants.CM8.path_loss_exponent
_ENTRIES = 32
_REPEATED = 8
_FADED_MOVE_M = 4.0 * constants.FADING_LENGTH_M


@dataclass(frozen=True, slots=True)
class RangeLaw:
    """Table of receptions; `cells` = distances x (clear, losses x detours, sealed x detours)."""

    error_m: Reals  # (cells, entries), rising; NaN = lost
    link_class: Indices  # (cells, entries)
    level_dbm: Reals
    receive_power_dbm: Reals
    first_path_power_dbm: Reals
    white_sd_m: Reals  # (cells,), of ranges between ends at rest
    detour_m: Reals  # (cells,), that the errors were found with
    kept: float  # rank correlation of a link's error when only its fading has changed


def cell_of(way: Obstruction) -> Indices:
    """Cell of each link (n,), nearest on a logarithmic scale."""
    kinds = 1 + (len(_LOSS_DB) + 1) * len(_DETOUR_M)
    detour_m = np.minimum(way.detour_m, _DETOUR_M[-1])
    loss = np.where(way.sealed, len(_LOSS_DB), _nearest(_LOSS_DB, way.loss_db))
    kind = np.where(way.loss_db > 0.0, 1 + loss * len(_DETOUR_M) + _nearest(_DETOUR_M + 0.05, detour_m + 0.05), 0)
    further = 10.0 ** (way.further_loss_db / _SCATTERED_SLOPE_DB)
    reach_m = (way.distance_m + detour_m) * further - detour_m
    distance_m = np.where(way.sealed & np.isfinite(way.detour_m), reach_m, way.distance_m)
    return _nearest(_DISTANCE_M, distance_m) * kinds + kind


def _nearest(grid: Reals, values: Reals) -> Indices:
    borders = np.sqrt(grid[1:] * grid[:-1])
    return np.searchsorted(borders, values)


def _grid() -> Obstruction:
    """One link a cell."""
    rows = []
    for distance_m in _DISTANCE_M:
        rows.append((distance_m, 0.0, 0.0, False))
        rows += [(distance_m, loss_db, detour_m, False) for loss_db in _LOSS_DB for detour_m in _DETOUR_M]
        rows += [(distance_m, 300.0, max(detour_m, 0.05), True) for detour_m in _DETOUR_M]
    distance_m, loss_db, detour_m, sealed = np.array(rows).T
    return Obstruction(distance_m, loss_db, np.zeros(len(rows)), detour_m, np.zeros(len(rows)), sealed > 0.0)


@cache
def range_law(environment: Environment) -> RangeLaw:
    """Build the table of an environment, some seconds once a process; always the same."""
    way, rng = _grid(), np.random.default_rng(15)
    cells = len(way.distance_m)
    channel, every = LinkChannel(environment, cells, rng), np.arange(cells)
    draws, again, faded = [], [], []
    for entry in range(_ENTRIES):
        draws.append(_receive(channel, every, 1e3, way, rng))
        if entry < _REPEATED:
            again.append(_receive(channel, every, 0.0, way, rng).error_m)
            faded.append(_receive(channel, every, _FADED_MOVE_M, way, rng).error_m)
    error_m = np.stack([draw.error_m for draw in draws], axis=1)
    order = np.argsort(error_m, axis=1)

    def sorted_entries(values: Iterable[NDArray[Any]]) -> NDArray[Any]:
        return np.take_along_axis(np.stack(list(values), axis=1), order, axis=1)

    return RangeLaw(
        error_m=np.take_along_axis(error_m, order, axis=1),
        link_class=sorted_entries(draw.link_class for draw in draws),
        level_dbm=sorted_entries(draw.level_dbm for draw in draws),
        receive_power_dbm=sorted_entries(draw.registers.receive_power_dbm for draw in draws),
        first_path_power_dbm=sorted_entries(draw.registers.first_path_power_dbm for draw in draws),
        white_sd_m=_white_sd(error_m[:, :_REPEATED] - np.stack(again, axis=1)),
        detour_m=way.detour_m,
        kept=_rank_correlation(error_m[:, :_REPEATED], np.stack(faded, axis=1)),
    )


def _receive(
    channel: LinkChannel, every: Indices, moved_m: float, way: Obstruction, rng: np.random.Generator
) -> Exchanges:
    batch = channel.respond(every[None], np.full((1, len(every)), moved_m), way)
    radios = [Radios.draw(len(every), rng).receiver for _ in range(2)]
    return exchange(batch, way.loss_db, radios[0], radios[1], rng)


def _white_sd(difference_m: Reals) -> Reals:
    """Robust standard deviation (cells,) of one of two values with differences (cells, k), over all distances."""
    by_kind = np.abs(difference_m).reshape(len(_DISTANCE_M), -1, difference_m.shape[1])
    middle = np.nanmedian(by_kind, axis=(0, 2)) * 1.4826 / np.sqrt(2.0)
    return np.tile(middle, len(_DISTANCE_M))


def _rank_correlation(first: Reals, second: Reals) -> float:
    """Median over cells (n, k) of Spearman's correlation, 0..1."""
    both = np.isfinite(first).all(axis=1) & np.isfinite(second).all(axis=1)
    ranks = [np.argsort(np.argsort(values[both], axis=1), axis=1) for values in (first, second)]
    centred = [rank - rank.mean(axis=1, keepdims=True) for rank in ranks]
    return float(np.clip(np.mean(centred[0] * centred[1]) / np.mean(centred[0] ** 2), 0.0, 1.0))


class FastTagLinks:
    """Links between one tag and `count` anchors, as `ranging_link.TagLinks`, many rounds at a time."""

    def __init__(
        self, environment: Environment, tag: Radios, anchors: Radios, wearer: Wearer, rng: np.random.Generator
    ) -> None:
        count = len(anchors.offset_m)
        self._law = range_law(environment)
        self._offset_m, self._wearer, self._rng = anchors.offset_m + tag.offset_m[0], wearer, rng
        self._bias = GaussMarkov(count, constants.SLOW_BIAS_LENGTH_M, rng)
        self._body = body_process(count, rng)
        self._slow = GaussMarkov(count, constants.CLUSTER_LENGTH_M, rng)
        self._quick = GaussMarkov(count, constants.FADING_LENGTH_M, rng)
        self._whereabouts = Whereabouts(count)

    def measure(self, tag_m: Reals, facing_rad: Reals, anchor_m: Reals, which: Indices, ways: LinkGeometry) -> Ranges:
        """Range in `r` rounds with `k` anchors each.

        tag_m: (r, 3) map, m; facing_rad: (r,) yaw, ENU; anchor_m: (r, k, 3) of anchors `which` (r, k), no doubles in a
        round; ways: geometry of the r x k links, round by round. Returns r x k ranges in that order.
        """
        moved_m = self._whereabouts.moved(tag_m, anchor_m, which)
        body = self._wearer.shadow(off_facing(tag_m, facing_rad, anchor_m), self._body.walk(which, moved_m))
        way = obstruction(ways, *body)
        rank = np.sqrt(self._law.kept) * self._slow.walk(which, moved_m)
        rank += np.sqrt(1.0 - self._law.kept) * self._quick.walk(which, moved_m)
        cell = cell_of(way)
        entry = np.minimum((ndtr(rank) * _ENTRIES).astype(int), _ENTRIES - 1)
        law, link_class = self._law, self._law.link_class[cell, entry]
        by_level_m = level_bias_m(law.level_dbm[cell, entry])
        direct = link_class > 1
        range_m = way.distance_m + law.error_m[cell, entry] + np.where(direct, way.delay_m, 0.0) + by_level_m
        range_m += np.where(way.sealed, way.detour_m - law.detour_m[cell], 0.0)  # inf = no way at all
        range_m += constants.SLOW_BIAS_SD_M * self._bias.walk(which, moved_m) + self._offset_m[which.ravel()]
        range_m += law.white_sd_m[cell] * self._rng.standard_normal(len(cell))
        range_m -= early_false_paths_m(len(cell), self._rng)
        powers = law.receive_power_dbm[cell, entry], law.first_path_power_dbm[cell, entry]
        range_m[np.isinf(range_m)] = np.nan
        return Ranges(np.isfinite(range_m), range_m, by_level_m, link_class, *powers, None)
