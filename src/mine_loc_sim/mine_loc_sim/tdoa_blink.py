"""Range differences of a blink: the same links as two-way ranges, seen by anchors whose clocks are not quite one."""

import numpy as np
from numpy.typing import NDArray

from mine_loc_sim import radio_constants as constants
from mine_loc_sim.gauss_markov import GaussMarkov


class AnchorSync:
    """Errors of `count` anchors' clocks against the section's common time, slowly varying."""

    def __init__(self, count: int, rng: np.random.Generator) -> None:
        self._process = GaussMarkov(count, constants.ANCHOR_SYNC_TIME_S, rng)
        self._every = np.arange(count)

    def advance(self, gone_s: float) -> NDArray[np.float64]:
        """Let `gone_s` >= 0 pass; returns each clock's error as a way [m], (count,)."""
        errors = self._process.advance(self._every, np.full(len(self._every), gone_s))
        return np.asarray(constants.LIGHT_M_PER_S * constants.ANCHOR_SYNC_SD_S * errors)


def range_differences(range_m: NDArray[np.float64], sync_m: NDArray[np.float64], reference: int) -> NDArray[np.float64]:
    """Differences [m] of arrival at `k` anchors to that at anchor number `reference` of them, (k,), 0 there.

    range_m: (k,) ranges as `TagLinks` reports them, NaN = not heard; sync_m: (k,) clock errors of these anchors. What
    the tag's radio adds to every range cancels. NaN where either was not heard.
    """
    arrival = range_m + sync_m
    return np.asarray(arrival - arrival[reference])
