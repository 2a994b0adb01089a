"""Whether a claimed covariance is true, on errors whose law is known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import sqrtm

from mine_loc_core.consistency import consistent_mean_nees, independent_count, nees, share_interval


def correlated(count, memory, seed):
    """A first-order autoregressive series."""
    noise = np.random.default_rng(seed).normal(size=count)
    series = np.empty(count)
    value = 0.0
    for number in range(count):
        value = memory * value + noise[number] * np.sqrt(1 - memory**2)
        series[number] = value
    return series


@given(xx=st.floats(0.01, 100.0), yy=st.floats(0.01, 100.0), r=st.floats(-0.95, 0.95), x=st.floats(-5, 5))
def test_nees_is_the_squared_length_in_units_of_the_deviation(xx, yy, r, x):
    covariance = np.array([[xx, r * np.sqrt(xx * yy)], [r * np.sqrt(xx * yy), yy]])
    unit = np.array([x, 1.0])
    error = np.real(sqrtm(covariance)) @ unit
    assert nees(error[None], covariance[None]) == pytest.approx([unit @ unit], rel=1e-6)


def test_a_covariance_that_is_none_gives_no_nees():
    covariances = np.array([np.eye(2), np.zeros((2, 2)), -np.eye(2), np.full((2, 2), np.nan)])
    found = nees(np.ones((4, 2)), covariances)
    assert found[0] == pytest.approx(2.0)
    assert np.isnan(found[1:]).all()


@settings(max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_the_mean_nees_of_an_honest_estimator_is_mostly_within_its_interval(seed):
    errors = np.random.default_rng(seed).normal(size=(400, 300, 2))
    means = (errors**2).sum(axis=2).mean(axis=1)
    interval = consistent_mean_nees(2, 300.0)
    assert np.mean((means > interval.low) & (means < interval.high)) == pytest.approx(0.95, abs=0.05)


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
def test_correlated_errors_are_worth_fewer(memory):
    count = 20_000
    worth = np.mean([independent_count(correlated(count, memory, seed)) for seed in range(5)])
    assert worth == pytest.approx(count * (1 - memory) / (1 + memory), rel=0.15)


@pytest.mark.parametrize(("values", "worth"), [([], 0.0), ([3.0], 1.0), ([0.5] * 100, 1.0)])
def test_what_does_not_vary_is_worth_one(values, worth):
    assert independent_count(np.array(values)) == worth


@given(share=st.floats(0.0, 1.0), count=st.floats(1.0, 1e6))
def test_the_interval_of_a_share_holds_it_and_stays_between_none_and_all(share, count):
    interval = share_interval(share, count)
    assert 0.0 <= interval.low <= share + 1e-12
    assert share - 1e-12 <= interval.high <= 1.0


def test_the_interval_of_a_share_is_wilsons():
    interval = share_interval(0.9, 100.0)
    assert (interval.low, interval.high) == (pytest.approx(0.8256, abs=1e-4), pytest.approx(0.9448, abs=1e-4))
