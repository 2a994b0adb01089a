"""A radio's 40-bit clock."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_sim.device_ticks import DeviceTicks

WRAP = 1 << 40
TICK_NS = 15.650040064e-3


def test_ticks_follow_true_time_at_the_crystals_rate():
    clock = DeviceTicks(np.random.default_rng(1))
    first = clock.at(0)
    gone = (clock.at(1_000_000_000) - first) % WRAP
    assert gone * TICK_NS == pytest.approx(1e9 * (1 + clock.rate_ppm * 1e-6), abs=100.0)


def test_the_counter_wraps_after_17_2_seconds():
    clock = DeviceTicks(np.random.default_rng(2))
    ticks = [clock.at(t * 1_000_000_000) for t in range(40)]
    assert sum(after < before for before, after in itertools.pairwise(ticks)) == 2
    assert all(0 <= tick < WRAP for tick in ticks)


@given(st.lists(st.integers(0, 10**12), min_size=2, max_size=20))
def test_unwrapped_ticks_never_run_backwards(stamps):
    clock = DeviceTicks(np.random.default_rng(3))
    ordered = sorted(stamps)
    ticks = [clock.at(stamp) for stamp in ordered]
    for (before, after), (first, second) in zip(itertools.pairwise(ticks), itertools.pairwise(ordered), strict=True):
        expected = (second - first) / TICK_NS
        error = ((after - before) - round(expected) + WRAP // 2) % WRAP - WRAP // 2
        assert abs(error) < 3.0 + expected * 30e-6


def test_time_running_backwards_is_refused_with_both_stamps():
    clock = DeviceTicks(np.random.default_rng(4))
    clock.at(10)
    with pytest.raises(ValueError, match="stamp_ns: 9 is before the last one, 10"):
        clock.at(9)
