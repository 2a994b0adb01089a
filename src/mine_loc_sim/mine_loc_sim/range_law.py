"""Ranges without accumulators, by a law that `range_law_learning` learns from the accumulators.

Receptions are simulated over a grid of distance, loss and way round; each cell keeps their errors in order, with the
class and powers that came with each. A link then walks through its cell's errors by a slowly varying rank, so that
spread, skewness, losses and correlation along a way are those of the full level. No number here is set by hand.
"""

from functools import cache
from importlib import resources

import numpy as np
from scipy.special import ndtr

from mine_loc_sim import radio_constants as constants
from mine_loc_sim.gauss_markov import GaussMarkov
from mine_loc_sim.mine import LinkGeometry
from mine_loc_sim.radio_constants import INDUSTRIAL, Environment
from mine_loc_sim.range_bias import level_bias_m
from mine_loc_sim.range_law_learning import learn_law
from mine_loc_sim.range_table import ENTRIES, RangeLaw, cell_of, read_law
from mine_loc_sim.ranging_link import (
    Indices,
    Radios,
    Ranges,
    Reals,
    Whereabouts,
    early_false_paths_m,
    obstruction,
    off_facing,
)
from mine_loc_sim.wearer import Wearer, body_process

_SHIPPED = "range_law_industrial.npz"


@cache
def range_law(environment: Environment) -> RangeLaw:
    """Return the law of an environment: of INDUSTRIAL as shipped, of others learnt, some seconds once a process."""
    if environment != INDUSTRIAL:
        return learn_law(environment)
    with resources.files("mine_loc_sim").joinpath(_SHIPPED).open("rb") as file:
        return read_law(file)


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
        entry = np.minimum((ndtr(rank) * ENTRIES).astype(int), ENTRIES - 1)
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
