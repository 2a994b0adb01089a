import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_uwb.antenna_delay import TICK_M, fit_offset_m, offset_of_delay_m, ticks_of_offset


def test_a_tick_is_as_long_as_light_goes_in_15_65_ps():
    assert pytest.approx(4.69e-3, abs=1e-5) == TICK_M


def test_a_delay_set_too_small_makes_ranges_long():
    assert offset_of_delay_m(true_ticks=16_453, set_ticks=16_384) == pytest.approx(69 * 4.69e-3, abs=1e-3)
    assert offset_of_delay_m(true_ticks=16_384, set_ticks=16_453) < 0.0


@given(st.integers(-5000, 5000))
def test_ticks_and_offset_are_each_others_inverse(ticks):
    assert ticks_of_offset(offset_of_delay_m(16_384 + ticks, 16_384)) == ticks


def test_the_offset_is_where_most_clear_ranges_lie():
    assert fit_offset_m(np.array([0.15, 0.16, 0.14, 9.0, np.nan, 0.15])) == pytest.approx(0.15)
    assert fit_offset_m(np.array([np.nan])) == 0.0
