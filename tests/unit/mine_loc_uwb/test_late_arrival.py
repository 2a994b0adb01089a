"""The law of lateness: a density that is one, moments that are its own, and an offset that is really out of it."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mine_loc_uwb.late_arrival import LateArrival


@given(st.floats(0.0, 1.0), st.floats(0.05, 8.0), st.floats(0.02, 1.5))
@settings(max_examples=40)
def test_the_density_integrates_to_one_over_its_span(late, delay_m, sd_m):
    law = LateArrival(late, delay_m, floor_probability=1e-9)
    grid = np.arange(-10.0 * sd_m, 10.0 * sd_m + 25.0 * delay_m, 0.02 * min(sd_m, delay_m + sd_m))
    density = np.exp(law.log_density(grid, np.array(sd_m), np.array(delay_m)))
    assert np.trapezoid(density, grid) == pytest.approx(1.0, abs=2e-3)


def test_mean_and_variance_are_those_of_the_law():
    law, rng, count = LateArrival(0.4, 2.0, floor_probability=0.0), np.random.default_rng(1), 400_000
    delays = np.where(rng.random(count) < 0.4, rng.exponential(2.0, count), 0.0)
    mean_m, variance_m2 = law.moments(np.array([np.nan]))
    assert mean_m[0] == pytest.approx(delays.mean(), rel=0.02)
    assert variance_m2[0] == pytest.approx(delays.var(), rel=0.02)


def test_weaker_arrivals_are_later_up_to_a_limit():
    law = LateArrival(1.0, 0.5, growth_per_db=0.2, most_delay_m=6.0)
    assert law.delays_m(np.array([-82.0, -92.0, -97.0, -140.0, np.nan])) == pytest.approx(
        [0.5 * np.exp(-2.0), 0.5, 0.5 * np.exp(1.0), 6.0, 0.5]
    )


def test_a_late_arrival_costs_less_than_an_early_one_and_neither_costs_without_end():
    law, sd, delay = LateArrival(), np.array(0.1), np.array(1.0)
    early, late, lost = law.log_density(np.array([-2.0, 2.0, -1e6]), sd, delay)
    assert late > early
    assert np.isfinite(lost)


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1), st.integers(2, 6), st.floats(-1e3, 1e3))
def test_a_shared_offset_changes_nothing(seed, count, offset_m):
    rng, law = np.random.default_rng(seed), LateArrival()
    late_m = rng.exponential(1.0, (20, count))
    sd_m, delay_m = rng.uniform(0.1, 0.3, count), rng.uniform(0.5, 3.0, count)
    here = law.log_likelihood(late_m, sd_m, delay_m, shared_offset=True)
    there = law.log_likelihood(late_m + offset_m, sd_m, delay_m, shared_offset=True)
    assert there == pytest.approx(here, abs=1e-3)


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1), st.integers(2, 5))
@example(83197928, 2).via("one of two arrivals from no path")
def test_the_offset_is_integrated_out(seed, count):
    rng, law = np.random.default_rng(seed), LateArrival(0.7, 1.5)
    late_m = rng.exponential(1.5, (8, count)) + 0.2 * rng.standard_normal((8, count))
    sd_m, delay_m = np.full(count, 0.2), np.full(count, 1.5)
    offsets = np.arange(-40.0, 40.0, 0.01)
    dense = law.log_density(late_m[:, :, None] - offsets, sd_m[:, None], delay_m[:, None]).sum(axis=1)
    expected = np.log(np.trapezoid(np.exp(dense), offsets, axis=1))
    # The window leaves out offsets that would need several values from no path at all.
    assert law.log_likelihood(late_m, sd_m, delay_m, shared_offset=True) == pytest.approx(expected, abs=0.05)


def test_with_normal_arrivals_the_likelihood_is_that_of_time_differences():
    law, rng = LateArrival(0.0, floor_probability=1e-12), np.random.default_rng(4)
    late_m, sd_m = 0.2 * rng.standard_normal((50, 4)), np.full(4, 0.2)
    differences = late_m[:, 1:] - late_m[:, :1]
    covariance = 0.04 * (np.eye(3) + 1.0)
    expected = -0.5 * np.einsum("ki,ij,kj->k", differences, np.linalg.inv(covariance), differences)
    expected -= 0.5 * np.log(np.linalg.det(2 * np.pi * covariance))
    found = law.log_likelihood(late_m, sd_m, np.ones(4), shared_offset=True)
    assert found == pytest.approx(expected, abs=0.04)


def test_nothing_heard_says_nothing():
    found = LateArrival().log_likelihood(np.empty((5, 0)), np.empty(0), np.empty(0), shared_offset=True)
    assert found == pytest.approx(np.zeros(5))
