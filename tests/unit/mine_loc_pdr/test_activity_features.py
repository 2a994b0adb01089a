"""Features of a window: the same to either side, and large where the person turns."""

import math

import numpy as np
import pytest
from activity_samples import window

from mine_loc_pdr.activity_features import FEATURES, log_vertical_sd, matrix, profile, turn, turn_and_gait
from mine_loc_pdr.activity_window import BINS, ActivityWindow


@pytest.mark.parametrize("name", FEATURES)
@pytest.mark.parametrize("turn_deg", [5.0, 60.0, 180.0])
def test_a_turn_to_the_right_has_the_features_of_one_to_the_left(name, turn_deg):
    left, right = (FEATURES[name](window(sign * turn_deg)) for sign in (1.0, -1.0))
    np.testing.assert_allclose(left, right, atol=1e-12)


def test_turn_is_the_change_of_heading_and_its_greatest_between_two_instants():
    np.testing.assert_allclose(np.degrees(turn(window(90.0))), [90.0, 90.0, 90.0], atol=1e-9)


def test_to_and_fro_is_no_change_from_end_to_end_but_one_between_instants():
    there_and_back = window(60.0, begin_s=0.5).heading_rad - window(60.0, begin_s=2.5).heading_rad
    to_and_fro = ActivityWindow(0, there_and_back, np.zeros(BINS), np.ones(BINS))
    change, greatest, _ = np.degrees(turn(to_and_fro))
    assert change == pytest.approx(0.0, abs=1e-9)
    assert greatest == pytest.approx(60.0)


def test_smoothing_takes_out_the_swing_of_the_pelvis():
    _, greatest, smoothed = np.degrees(turn(window(0.0, swing_deg=5.0)))
    assert greatest > 9.0
    assert smoothed < 0.1


def test_profile_says_where_in_the_window_the_turn_lies():
    pieces = np.degrees(profile(window(-80.0, begin_s=0.8, lasts_s=0.4)))
    assert pieces.shape == (BINS // 2,)
    assert pieces[2] == pytest.approx(80.0)
    assert np.delete(pieces, 2) == pytest.approx(0.0, abs=1e-9)


def test_gait_is_told_by_how_briskly_the_waist_goes_up_and_down():
    assert log_vertical_sd(window(0.0, sd_m_s2=1.5)) == pytest.approx(math.log(1.5))
    *_, brisk, weakest = turn_and_gait(window(0.0, sd_m_s2=1.5))
    assert brisk == weakest == pytest.approx(math.log(1.5))


def test_a_constant_error_of_the_accelerometer_is_no_gait():
    offset = ActivityWindow(0, np.zeros(BINS + 1), np.full(BINS, 0.4), np.full(BINS, 0.16))
    assert log_vertical_sd(offset) < math.log(0.01)


def test_a_sensor_that_repeats_itself_to_the_last_bit_has_finite_features():
    dead = ActivityWindow(0, np.zeros(BINS + 1), np.zeros(BINS), np.zeros(BINS))
    assert all(np.isfinite(FEATURES[name](dead)).all() for name in FEATURES)


@pytest.mark.parametrize("name", FEATURES)
def test_a_matrix_has_a_row_a_window(name):
    rows = matrix(name, [window(0.0), window(90.0)])
    np.testing.assert_array_equal(rows[1], FEATURES[name](window(90.0)))
    assert rows.shape == (2, len(rows[1]))
