"""A first position from one round: exact, robust to long ranges, and honest about mirror images."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from uwb_scenes import LINE, ROOM, distances, is_covariance

from mine_loc_uwb.consensus_fix import consensus_fix

TAG = np.array([6.0, 5.0, 1.0])


def find(anchors, ranges, height_m=1.0):
    return consensus_fix(anchors, ranges, range_sd_m=0.05, nlos_scale_m=0.6, height_m=height_m)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(4, 9), st.sampled_from([1.0, None]))
def test_exact_ranges_give_the_exact_position_unless_another_is_as_good(seed, count, height_m):
    rng = np.random.default_rng(seed)
    anchors, tag = rng.uniform([0, 0, 0], [40, 40, 8], (count, 3)), rng.uniform([0, 0, 1], [40, 40, 1], 3)
    found = find(anchors, distances(anchors, tag), height_m)
    assume(found is not None)
    assert is_covariance((found.covariance_m2 + found.covariance_m2.T) / 2)
    if found.ambiguous:
        assume(False)
    assert found.position_m == pytest.approx(tag[: len(found.position_m)], abs=0.02)
    assert found.agreeing.all()


@pytest.mark.parametrize("height_m", [1.0, None])
@pytest.mark.parametrize("late", [{0: 2.0}, {3: 6.0}, {0: 1.0, 5: 4.0}, {2: 3.0, 3: 3.0}], ids=str)
def test_one_and_two_long_ranges_of_six_are_seen_through(late, height_m):
    rng, ranges = np.random.default_rng(4), distances(ROOM, TAG)
    ranges += rng.normal(0, 0.05, len(ROOM))
    for place, excess_m in late.items():
        ranges[place] += excess_m
    found = find(ROOM, ranges, height_m)
    assert not found.ambiguous
    assert found.position_m == pytest.approx(TAG[: len(found.position_m)], abs=0.2 if height_m else 0.6)
    assert not found.agreeing[list(late)].any()
    if height_m:
        assert found.agreeing.sum() == len(ROOM) - len(late)


def test_two_long_ranges_of_six_lead_astray_seldom():
    rng, errors = np.random.default_rng(4), []
    for _ in range(60):
        tag = np.array([*rng.uniform([1, 1], [19, 14]), 1.0])
        ranges = distances(ROOM, tag) + rng.normal(0, 0.05, len(ROOM))
        ranges[rng.choice(len(ROOM), 2, replace=False)] += rng.uniform(0.5, 6.0, 2)
        errors.append(np.linalg.norm(find(ROOM, ranges).position_m - tag[:2]))
    assert np.median(errors) < 0.08
    assert np.mean(np.array(errors) > 0.3) < 0.15


@pytest.mark.parametrize("offset_m", [2.0, 4.0, 9.0])
def test_the_mirror_image_behind_a_line_of_anchors_is_reported_and_spanned(offset_m):
    ranges = distances(LINE, (22.0, offset_m, 1.0)) + np.random.default_rng(1).normal(0, 0.05, len(LINE))
    found = find(LINE, ranges)
    assert found.ambiguous
    assert found.agreeing.all()
    assert found.position_m == pytest.approx([22.0, 0.0], abs=0.3)
    for image_m in (offset_m, -offset_m):
        off = np.array([22.0, image_m]) - found.position_m
        assert off @ np.linalg.solve(found.covariance_m2, off) < 4.0


def test_two_ranges_at_a_known_height_are_two_places():
    found = find(ROOM[:2], distances(ROOM[:2], TAG))
    assert found.ambiguous
    assert found.position_m[1] == pytest.approx(0.0, abs=0.1)  # the mirror image is behind the line of the two


@pytest.mark.parametrize(("count", "height_m"), [(0, 1.0), (1, 1.0), (2, None)])
def test_fewer_ranges_than_coordinates_give_nothing(count, height_m):
    assert find(ROOM[:count], distances(ROOM[:count], TAG), height_m) is None


def test_anchors_in_one_place_give_nothing():
    anchors = np.repeat(ROOM[:1], 4, axis=0)
    assert find(anchors, distances(anchors, TAG)) is None


def test_ranges_that_contradict_each_other_widen_what_is_claimed():
    ranges = distances(ROOM, TAG)
    agreed, torn = (find(ROOM, ranges + np.array([late, 0.0, late, 0.0, late, 0.0])) for late in (0.0, 2.0))
    assert np.trace(torn.covariance_m2) > 3.0 * np.trace(agreed.covariance_m2)
    error = torn.position_m - TAG[:2]
    assert error @ np.linalg.solve(torn.covariance_m2, error) < 9.0
