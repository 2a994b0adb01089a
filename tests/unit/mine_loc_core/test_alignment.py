"""Laying a track over truth that has its own clock and frame."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_core.alignment import Alignment, align, rigid_2d, truth_at


def walk(times_s):
    """A path without symmetry, at changing speed."""
    return np.column_stack(
        [4 * np.sin(0.5 * times_s) + 0.3 * times_s, 3 * np.cos(0.31 * times_s) + np.sin(1.1 * times_s)]
    )


TRUTH_S = np.arange(0.0, 40.0, 0.02)


@given(yaw=st.floats(-3.1, 3.1), x=st.floats(-1e4, 1e4), y=st.floats(-1e4, 1e4))
def test_a_rigid_motion_is_found(yaw, x, y):
    source = walk(np.arange(0.0, 20.0, 1.0))
    target = Alignment(0.0, yaw, np.array([x, y])).apply(source)
    found_yaw, shift = rigid_2d(source, target)
    assert found_yaw == pytest.approx(yaw, abs=1e-7)
    assert shift == pytest.approx([x, y], abs=1e-6)


def test_a_mirrored_track_stays_mirrored():
    source = walk(np.arange(0.0, 20.0, 1.0))
    mirrored = source * [1.0, -1.0]
    yaw, shift = rigid_2d(source, mirrored)
    assert np.linalg.norm(Alignment(0.0, yaw, shift).apply(source) - mirrored, axis=1).mean() > 0.5


@settings(max_examples=10)
@given(offset_s=st.floats(-1.9, 1.9), yaw=st.floats(-3.0, 3.0), seed=st.integers(0, 1000))
def test_offset_and_transform_are_found_through_noise(offset_s, yaw, seed):
    times_s = np.arange(5.0, 35.0, 0.1)
    clean = Alignment(0.0, yaw, np.array([5.0, -7.0])).apply(walk(times_s + offset_s))
    track = clean + np.random.default_rng(seed).normal(0.0, 0.05, clean.shape)
    found = align(times_s, track, TRUTH_S, walk(TRUTH_S), search_s=2.0)
    assert found.time_offset_s == pytest.approx(offset_s, abs=0.02)
    assert found.yaw_rad == pytest.approx(yaw, abs=0.01)
    laid = found.apply(truth_at(times_s + found.time_offset_s, TRUTH_S, walk(TRUTH_S)))
    assert np.sqrt(np.mean(np.sum((laid - clean) ** 2, axis=1))) < 0.03


def test_an_offset_beyond_the_search_is_not_reported():
    times_s = np.arange(10.0, 30.0, 0.1)
    found = align(times_s, walk(times_s + 1.5), TRUTH_S, walk(TRUTH_S), search_s=0.5)
    assert abs(found.time_offset_s) <= 0.5


def test_truth_that_covers_less_than_half_of_the_track_is_refused():
    times_s = np.arange(100.0, 120.0, 0.1)
    with pytest.raises(ValueError, match="half"):
        align(times_s, walk(times_s), TRUTH_S, walk(TRUTH_S), search_s=2.0)


def test_truth_at_an_instant_is_interpolated_and_unknown_outside():
    found = truth_at(np.array([-1.0, 0.5, 3.0]), np.array([0.0, 1.0]), np.array([[0.0, 2.0], [1.0, 4.0]]))
    assert found[1] == pytest.approx([0.5, 3.0])
    assert np.isnan(found[[0, 2]]).all()


def test_without_a_transform_the_offset_alone_is_found():
    times_s = np.arange(5.0, 35.0, 0.1)
    found = align(
        times_s, walk(times_s + 0.4) + np.array([0.3, 0.0]), TRUTH_S, walk(TRUTH_S), search_s=2.0, rigid=False
    )
    assert (found.yaw_rad, found.shift_m.tolist()) == (0.0, [0.0, 0.0])
    assert found.time_offset_s == pytest.approx(0.4, abs=0.15)


def test_without_a_search_the_transform_alone_is_found():
    times_s = np.arange(5.0, 35.0, 0.1)
    turned = Alignment(0.0, 0.7, np.array([1.0, 2.0]))
    found = align(times_s, turned.apply(walk(times_s)), TRUTH_S, walk(TRUTH_S), search_s=0.0)
    assert found.time_offset_s == 0.0
    assert found.yaw_rad == pytest.approx(0.7, abs=1e-4)
