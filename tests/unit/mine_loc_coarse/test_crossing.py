import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_coarse.crossing import cross, pairs_within

PLACES_M = np.array([[0.0, 0.0], [4000.0, 0.0]])
VARIANCE = np.full(2, math.radians(2.0) ** 2)
FIRST, SECOND = np.array([0]), np.array([1])


def crossed(azimuth_rad, variance=VARIANCE, places_m=PLACES_M):
    return cross(places_m, np.asarray(azimuth_rad), variance, FIRST, SECOND, 5000.0)


def towards(point_m, places_m=PLACES_M):
    way_m = np.asarray(point_m) - places_m
    return np.arctan2(way_m[:, 1], way_m[:, 0])


@given(st.floats(0.0, 4000.0), st.floats(50.0, 2900.0), st.sampled_from([-1.0, 1.0]))
@settings(max_examples=200)
def test_a_point_projected_to_bearings_crosses_back_to_itself(x_m, y_m, side):
    point_m = np.array([x_m, side * y_m])
    found = crossed(towards(point_m))
    assert len(found) == 1
    assert found.position_m[0] == pytest.approx(point_m, abs=1e-5)


def test_distances_are_those_of_paper_e_with_the_denominators_sign_mended():
    point_m = np.array([1000.0, 2000.0])
    compass = math.pi / 2 - towards(point_m)
    length, beta = 4000.0, 0.0
    r_i = length * math.cos(compass[1] + beta) / math.sin(compass[0] - compass[1])
    found = crossed(towards(point_m))
    assert r_i == pytest.approx(math.hypot(1000.0, 2000.0))
    assert found.position_m[0] == pytest.approx([r_i * math.sin(compass[0]), r_i * math.cos(compass[0])])


def test_the_covariance_is_that_of_drawn_bearings():
    rng = np.random.default_rng(1)
    point_m = np.array([1500.0, 2000.0])
    drawn = [crossed(towards(point_m) + rng.normal(0.0, 0.005, 2)).position_m[0] for _ in range(4000)]
    told = crossed(towards(point_m), np.full(2, 0.005**2)).covariance_m2[0]
    assert np.cov(np.array(drawn).T) == pytest.approx(told, rel=0.1, abs=0.05 * np.trace(told))


@pytest.mark.parametrize(
    ("azimuth_deg", "reason"),
    [((100.0, 45.0), "behind"), ((80.0, 99.0), "out_of_range"), ((30.0, 30.0), "parallel")],
)
def test_what_no_emitter_can_be_at_is_refused_and_counted(azimuth_deg, reason):
    found = crossed(np.radians(azimuth_deg), np.full(2, 1e-8))
    assert len(found) == 0
    assert found.refused == {reason: 1}


def test_nearly_collinear_bearings_are_kept_with_their_long_covariance():
    found = crossed(towards([2000.0, 60.0]))
    assert len(found) == 1
    longest_m, shortest_m = np.sqrt(np.linalg.eigvalsh(found.covariance_m2[0])[::-1])
    assert longest_m > 500.0
    assert shortest_m < 100.0


def test_pairs_are_all_those_within_a_group():
    first, second = pairs_within(np.array([0, 0, 0, 2, 5, 5]))
    assert list(zip(first.tolist(), second.tolist(), strict=True)) == [(0, 1), (0, 2), (1, 2), (4, 5)]
