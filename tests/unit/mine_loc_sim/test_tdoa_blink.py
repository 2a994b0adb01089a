"""Range differences and the anchors' clocks behind them."""

import numpy as np
import pytest

from mine_loc_sim.gauss_markov import GaussMarkov
from mine_loc_sim.radio_constants import ANCHOR_SYNC_SD_S, LIGHT_M_PER_S
from mine_loc_sim.tdoa_blink import AnchorSync, range_differences


def test_what_the_tag_adds_to_every_range_cancels():
    ranges = np.array([10.0, 12.0, 9.0])
    sync = np.zeros(3)
    assert range_differences(ranges + 5.0, sync, 0) == pytest.approx([0.0, 2.0, -1.0])


def test_clock_errors_stay_in_the_differences():
    assert range_differences(np.array([10.0, 10.0]), np.array([0.1, -0.2]), 0) == pytest.approx([0.0, -0.3])


def test_an_anchor_that_heard_nothing_has_no_difference():
    differences = range_differences(np.array([10.0, np.nan, 9.0]), np.zeros(3), 0)
    assert np.isnan(differences[1])
    assert differences[2] == -1.0


def test_clock_errors_have_their_spread_and_hardly_change_within_a_round():
    sync = AnchorSync(20_000, np.random.default_rng(1))
    first, soon, late = sync.advance(0.0), sync.advance(0.1), sync.advance(60.0)
    assert first.std() == pytest.approx(LIGHT_M_PER_S * ANCHOR_SYNC_SD_S, rel=0.05)
    assert np.corrcoef(first, soon)[0, 1] > 0.97
    assert abs(np.corrcoef(first, late)[0, 1]) < 0.05


def test_gauss_markov_loses_memory_as_exp_of_the_way():
    process = GaussMarkov(50_000, 2.0, np.random.default_rng(2))
    every = np.arange(50_000)
    first = process.advance(every, np.zeros(50_000)).copy()
    second = process.advance(every, np.full(50_000, 1.0))
    assert np.corrcoef(first, second)[0, 1] == pytest.approx(np.exp(-0.5), abs=0.02)
    assert second.std() == pytest.approx(1.0, abs=0.02)


def test_processes_not_used_stand_still():
    process = GaussMarkov(3, 1.0, np.random.default_rng(3))
    before = process.advance(np.array([1, 2]), np.zeros(2)).copy()
    process.advance(np.array([0]), np.array([9.0]))
    assert np.array_equal(process.advance(np.array([1, 2]), np.zeros(2)), before)
