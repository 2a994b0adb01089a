"""The law of range errors: its densities, its score and information, and how wrong it calls an error."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import exponnorm

from mine_loc_core.gates import chi2_quantile
from mine_loc_uwb.one_sided_noise import deviance, excess_density, normal_density, score

VARIANCES = [1e-4, 0.01, 0.25, 9.0]
SCALES = [0.1, 0.6, 2.0]
OUTLIER = 2e-4


def log_law(error, variance, p, scale):
    return math.log((1 - p) * normal_density(error, variance) + p * excess_density(error, variance, scale) + OUTLIER)


@pytest.mark.parametrize("variance", VARIANCES)
def test_the_line_of_sight_law_integrates_to_one(variance):
    sd = math.sqrt(variance)
    assert quad(normal_density, -9 * sd, 9 * sd, (variance,))[0] == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("variance", VARIANCES)
@pytest.mark.parametrize("scale", SCALES)
def test_the_obstructed_law_integrates_to_one_and_is_late_by_its_scale_on_average(variance, scale):
    sd = math.sqrt(variance)
    low, high = -9 * sd, 9 * sd + 40 * scale
    points = [0.0, sd, 3 * sd + scale]
    assert quad(excess_density, low, high, (variance, scale), points=points, limit=400)[0] == pytest.approx(1, abs=1e-7)
    mean = quad(lambda e: e * excess_density(e, variance, scale), low, high, points=points, limit=400)[0]
    assert mean == pytest.approx(scale, rel=1e-6)


@settings(max_examples=80)
@given(st.floats(-60.0, 60.0), st.floats(1e-4, 1e4), st.floats(0.05, 5.0))
def test_the_obstructed_law_is_scipys_exponentially_modified_gaussian(error, variance, scale):
    sd = math.sqrt(variance)
    expected = exponnorm.pdf(error, scale / sd, scale=sd)
    assert excess_density(error, variance, scale) == pytest.approx(expected, rel=1e-6, abs=1e-250)


@pytest.mark.parametrize("sd", [21.0, 22.5, 30.0, 200.0])
def test_a_spread_of_many_scales_leaves_the_gaussian(sd):
    """After a silence the position is known to tens of metres: what an obstruction adds is nothing beside that."""
    for error in (-2.0 * sd, 0.0, 1.5 * sd):
        assert excess_density(error, sd**2, 0.6) == pytest.approx(normal_density(error - 0.6, sd**2), rel=2e-3)
        first, second, nlos = score(error, sd**2, 0.5, 0.6, 0.0)
        assert first == pytest.approx((error - 0.3) / sd**2, abs=0.03 / sd)
        assert second == pytest.approx(1.0 / sd**2, rel=0.01)
        assert nlos == pytest.approx(0.5, abs=0.03)


LAWS = (st.floats(1e-3, 900.0), st.floats(0.01, 0.97), st.floats(0.2, 2.0))


@settings(max_examples=80)
@given(st.floats(-4.0, 8.0), *LAWS)
def test_score_and_information_are_derivatives_of_the_logarithm_of_the_law(z, variance, p, scale):
    sd = math.sqrt(variance)
    error, step = z * sd, 1e-3 * min(sd, scale)
    below, here, above = (log_law(error + k * step, variance, p, scale) for k in (-1, 0, 1))
    first, second, _ = score(error, variance, p, scale, OUTLIER)
    size = 1.0 / min(sd, scale)
    assert first == pytest.approx(-(above - below) / (2 * step), rel=1e-3, abs=1e-3 * size)
    assert second == pytest.approx(-(above - 2 * here + below) / step**2, rel=1e-3, abs=2e-3 * size**2)


@settings(max_examples=80)
@given(st.floats(-300.0, 300.0), *LAWS)
def test_the_score_is_finite_and_p_a_probability_for_any_error(error, variance, p, scale):
    first, second, nlos = score(error, variance, p, scale, OUTLIER)
    assert math.isfinite(first)
    assert math.isfinite(second)
    assert 0.0 <= nlos <= 1.0


def test_what_neither_law_explains_pulls_nothing():
    assert score(-45.0, 0.01, 0.5, 0.6, OUTLIER)[0] == pytest.approx(0.0, abs=1e-12)


def test_a_long_range_makes_the_link_look_obstructed_and_a_fitting_one_clear():
    assert score(1.0, 0.01, 0.5, 0.6, OUTLIER)[2] > 0.99
    assert score(-0.1, 0.01, 0.5, 0.6, OUTLIER)[2] < 0.2


@settings(max_examples=50)
@given(st.floats(-3.0, 3.0), st.floats(1e-3, 100.0))
def test_the_deviance_of_a_clear_link_is_the_squared_mahalanobis_distance(error, variance):
    if error**2 / variance < 1400.0:  # beyond it the density underflows
        assert deviance(error, variance, 0.0, 0.6) == pytest.approx(error**2 / variance, rel=1e-9, abs=1e-9)


def test_a_range_that_is_too_short_is_as_wrong_as_it_looks_and_one_that_is_too_long_is_not():
    variance, p, scale = 0.01, 0.5, 0.6
    for error in (0.4, 0.8, 1.5):
        mahalanobis_sq = error**2 / variance
        assert deviance(-error, variance, p, scale) > 0.8 * mahalanobis_sq
        assert deviance(error, variance, p, scale) < 0.4 * mahalanobis_sq
        # Beyond the white noise the excess is exponential: what it costs grows with its length, not with the square.
    long, longer = (deviance(error, variance, p, scale) for error in (1.0, 2.0))
    assert longer - long == pytest.approx(2.0 * 1.0 / scale, rel=1e-6)


def test_the_deviance_of_the_impossible_is_infinite():
    assert deviance(-45.0, 0.01, 0.5, 0.6) == math.inf


@settings(max_examples=50)
@given(st.floats(-3.0, 9.0), *LAWS)
def test_a_squared_distance_is_never_negative(error, variance, p, scale):
    assert deviance(error, variance, p, scale) >= 0.0


def test_the_gate_of_a_clear_link_lets_pass_what_it_says():
    errors = np.random.default_rng(1).normal(0.0, 0.1, 20_000)
    passed = np.mean([deviance(error, 0.01, 0.0, 0.6) <= chi2_quantile(0.99, 1) for error in errors])
    assert passed == pytest.approx(0.99, abs=3 * math.sqrt(0.99 * 0.01 / len(errors)))
