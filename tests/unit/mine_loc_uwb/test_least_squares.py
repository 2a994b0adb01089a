"""Multilateration: exact where it can be, honest about its error, and no position where there is none."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mine_loc_uwb.fix import FixStatus
from mine_loc_uwb.least_squares import solve

ROOM = np.array([[0.0, 0.0, 2.4], [20.0, 1.0, 2.0], [19.0, 15.0, 2.6], [1.0, 16.0, 0.5], [9.0, 8.0, 3.0]])


def slant(anchors, tag):
    return np.linalg.norm(anchors - tag, axis=1)


def scene(seed, count, origin=0.0):
    rng = np.random.default_rng(seed)
    return rng.uniform(0, 40, (count, 3)) + origin, rng.uniform(0, 40, 3) + origin


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(3, 12), st.sampled_from([0.0, 5e3, -4e6]))
def test_exact_ranges_give_the_exact_position_at_a_known_height(seed, count, origin):
    anchors, tag = scene(seed, count, origin)
    fix = solve(anchors, slant(anchors, tag), range_sd_m=0.1, height_m=float(tag[2]))
    assume(fix.status is not FixStatus.DEGENERATE)
    assert fix.status is FixStatus.OK
    assert fix.position_m == pytest.approx(tag, abs=1e-4)
    assert (fix.dimensions, fix.ranges_used) == (2, count)
    assert fix.residual_rms_m < 1e-4
    assert np.linalg.eigvalsh(fix.covariance_m2)[0] >= -1e-12


@settings(max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(4, 12), st.sampled_from([0.0, 5e3]))
def test_exact_ranges_give_the_exact_position_in_space(seed, count, origin):
    anchors, tag = scene(seed, count, origin)
    fix = solve(anchors, slant(anchors, tag), range_sd_m=0.1)
    assume(fix.status is not FixStatus.DEGENERATE)
    assert fix.status is FixStatus.OK
    assert fix.position_m == pytest.approx(tag, abs=1e-4)
    assert fix.dimensions == 3


@pytest.mark.parametrize(("height_m", "enough"), [(1.0, 3), (None, 4)])
def test_too_few_ranges_give_no_position(height_m, enough):
    for count in range(enough):
        fix = solve(ROOM[:count], np.full(count, 5.0), range_sd_m=0.1, height_m=height_m)
        assert (fix.status, fix.ranges_used) == (FixStatus.TOO_FEW_RANGES, 0)
        assert np.isnan(fix.position_m).all()


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1), st.floats(-3.1, 3.1), st.sampled_from([0.0, 1e5]))
def test_anchors_on_a_line_or_in_one_place_determine_nothing(seed, yaw, origin):
    rng = np.random.default_rng(seed)
    along = rng.uniform(-50, 50, (6, 1)) * [np.cos(yaw), np.sin(yaw), 0.0] + origin
    tag = np.array([3.0, 4.0, 1.0]) + origin
    for anchors in (along, np.repeat(along[:1], 6, axis=0)):
        fix = solve(anchors, slant(anchors, tag) + rng.normal(0, 0.05, 6), range_sd_m=0.05, height_m=float(tag[2]))
        assert fix.status is FixStatus.DEGENERATE
        assert np.isnan(fix.position_m).all()


def test_anchors_in_one_plane_do_not_determine_the_height():
    anchors = ROOM * [1, 1, 0]
    assert solve(anchors, slant(anchors, np.array([5, 5, 1.0])), range_sd_m=0.1).status is FixStatus.DEGENERATE


def test_geometry_beyond_the_limit_is_degenerate_and_says_how_bad_it_is():
    anchors = ROOM[:3] * [1, 0.02, 1]
    fix = solve(anchors, slant(anchors, np.array([30.0, 0.1, 1.0])), range_sd_m=0.1, height_m=1.0, max_gdop=3.0)
    assert fix.status is FixStatus.DEGENERATE
    assert fix.gdop > 3.0


def test_a_tag_right_below_an_anchor_and_a_range_shorter_than_the_height_are_no_trouble():
    tag = np.array([9.0, 8.0, 1.0])
    ranges = slant(ROOM, tag)
    ranges[4] -= 0.3
    fix = solve(ROOM, ranges, range_sd_m=0.1, height_m=1.0)
    assert fix.status is FixStatus.OK
    assert fix.position_m == pytest.approx(tag, abs=0.3)


@pytest.mark.parametrize("height_m", [1.0, None])
@pytest.mark.parametrize("tag", [(6.0, 5.0, 1.0), (14.0, 12.0, 1.0), (25.0, -4.0, 1.0)])
def test_the_claimed_covariance_is_that_of_the_errors(tag, height_m):
    rng, runs, sd = np.random.default_rng(5), 1500, 0.05
    truth, dimensions = np.array(tag), 3 if height_m is None else 2
    nees = []
    for _ in range(runs):
        fix = solve(ROOM, slant(ROOM, truth) + rng.normal(0, sd, 5), range_sd_m=sd, height_m=height_m, max_gdop=1e3)
        error = (fix.position_m - truth)[:dimensions]
        nees.append(error @ np.linalg.solve(fix.covariance_m2[:dimensions, :dimensions], error))
    half_width = 1.96 * np.sqrt(2 * dimensions / runs)
    assert np.mean(nees) == pytest.approx(dimensions, abs=half_width)
