"""The probability of being inside, against closed forms and plain sampling."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm

from mine_loc_fusion.inside_probability import inside_probability
from mine_loc_fusion.zone_shape import ZoneShape, outline

HALF_PLANE = ZoneShape(np.array([[0.0, -500.0], [1000.0, -500.0], [1000.0, 500.0], [0.0, 500.0]]))


@given(st.floats(-8.0, 8.0), st.floats(0.1, 4.0), st.floats(0.1, 4.0), st.floats(-0.9, 0.9))
def test_at_a_straight_border_it_is_the_normal_distribution(x, sd_x, sd_y, correlation):
    covariance = np.array([[sd_x**2, correlation * sd_x * sd_y], [correlation * sd_x * sd_y, sd_y**2]])
    found = inside_probability(HALF_PLANE, np.array([x, 0.0]), covariance)
    assert found == pytest.approx(norm.cdf(x / sd_x), abs=0.009)


@pytest.mark.parametrize(("radius_m", "sd_m"), [(1.0, 0.5), (2.0, 2.0), (5.0, 4.0)])
def test_of_a_disc_round_the_mean_it_is_the_rayleigh_distribution(radius_m, sd_m):
    point = ZoneShape(np.array([[0.0, 0.0], [1e-6, 0.0], [0.0, 1e-6]]), radius_m)
    found = inside_probability(point, np.zeros(2), sd_m**2 * np.eye(2))
    assert found == pytest.approx(1.0 - math.exp(-0.5 * (radius_m / sd_m) ** 2), abs=0.009)


def test_of_a_vehicle_s_surroundings_it_is_what_sampling_finds():
    shape = ZoneShape(outline(6.0, 2.5), 2.0).placed(3.0, 1.0, 0.7)
    mean, covariance = np.array([7.0, 4.0]), np.array([[2.0, 1.2], [1.2, 1.5]])
    drawn = np.random.default_rng(1).multivariate_normal(mean, covariance, 200_000)
    assert inside_probability(shape, mean, covariance) == pytest.approx(
        np.mean(shape.signed_distance_m(drawn) <= 0.0), abs=0.009
    )


def test_without_spread_it_is_whether_the_mean_is_inside():
    shape = ZoneShape(outline(2.0, 2.0))
    assert inside_probability(shape, np.array([0.9, 0.0]), np.zeros((2, 2))) == 1.0
    assert inside_probability(shape, np.array([1.1, 0.0]), np.zeros((2, 2))) == 0.0


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_not_a_number_is_refused_and_not_judged(bad):
    with pytest.raises(ValueError, match="must be finite"):
        inside_probability(HALF_PLANE, np.array([bad, 0.0]), np.eye(2))
    with pytest.raises(ValueError, match="must be finite"):
        inside_probability(HALF_PLANE, np.zeros(2), np.diag([1.0, bad]))
