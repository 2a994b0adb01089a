"""The drift model against tracks whose errors are drawn: its covariance is what the errors really spread by."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from mine_loc_pdr.drift import (
    BIAS,
    HEADING,
    RATE_NOISE_RAD_SQRT_S,
    TURN_ON_BIAS_RAD_S,
    WALKING_SPEED_M_S,
    DriftModel,
    X,
    Y,
)

operations = st.one_of(
    st.tuples(st.just("pass_time"), st.floats(0, 5)),
    st.tuples(st.just("turn"), st.floats(-3, 3)),
    st.tuples(st.just("gap"), st.floats(0, 5)),
    st.tuples(st.just("rest"), st.none()),
    st.tuples(st.just("step"), st.floats(-3, 3)),
)


def apply(drift, operation):
    name, value = operation
    if name == "step":
        drift.step(0.7 * np.cos(value), 0.7 * np.sin(value), 1.0, 0.1, 0.1)
    elif name == "rest":
        drift.rest()
    else:
        getattr(drift, name)(value)


@given(st.lists(operations, max_size=60))
def test_the_covariance_stays_symmetric_and_positive_semi_definite(history):
    drift = DriftModel(0.01)
    for operation in history:
        apply(drift, operation)
        assert_allclose(drift.covariance, drift.covariance.T, atol=0)
        assert np.linalg.eigvalsh(drift.covariance).min() > -1e-9 * max(1.0, np.trace(drift.covariance))


def test_the_covariance_is_the_spread_of_drawn_tracks():
    """An L-shaped walk of 60 steps, 20 000 tracks with bias, rate noise, scale and step errors drawn."""
    rng = np.random.default_rng(4)
    runs, dt_s, length_m = 20_000, 0.6, 0.7
    along_m, across_m, scale_sd = 0.05, 0.04, 0.08
    drift = DriftModel(scale_sd**2)
    heading = np.zeros(runs)
    bias = rng.normal(0, TURN_ON_BIAS_RAD_S, runs)
    scale = rng.normal(0, scale_sd, runs)
    position = np.zeros((runs, 2))
    for k in range(60):
        true_heading = 0.0 if k < 30 else np.pi / 2
        heading += -bias * dt_s + rng.normal(0, RATE_NOISE_RAD_SQRT_S * dt_s**0.5, runs)
        direction = np.array((np.cos(true_heading), np.sin(true_heading)))
        side = np.array((-direction[1], direction[0]))
        along = length_m * scale + rng.normal(0, along_m, runs)
        position += np.outer(along, direction) + np.outer(length_m * heading + rng.normal(0, across_m, runs), side)
        drift.pass_time(dt_s)
        drift.step(*(length_m * direction), 1.0, along_m, across_m)
    drawn = np.cov(np.column_stack((position, heading)).T)
    index = [X, Y, HEADING]
    assert_allclose(drift.covariance[np.ix_(index, index)], drawn, rtol=0.08, atol=0.02 * drawn.max())


def test_position_error_grows_with_the_distance_because_heading_and_scale_errors_stay():
    drift = DriftModel(0.01)
    spread = []
    for _ in range(2):
        for _ in range(50):
            drift.step(0.7, 0.0, 1.0, 0.0, 0.0)
        spread.append(drift.covariance[X, X] ** 0.5)
    assert spread[1] == pytest.approx(2 * spread[0])
    assert spread[1] == pytest.approx(0.1 * 70.0)


def test_time_adds_up_the_same_in_one_go_and_in_many():
    once, often = DriftModel(0.01), DriftModel(0.01)
    once.pass_time(10.0)
    for _ in range(1000):
        often.pass_time(0.01)
    assert_allclose(often.covariance[HEADING, HEADING], once.covariance[HEADING, HEADING], rtol=1e-3)


def test_rest_teaches_the_bias_and_leaves_the_pose_alone():
    drift = DriftModel(0.01)
    drift.pass_time(60.0)
    before = drift.covariance.copy()
    gains = [drift.rest() for _ in range(10)]
    assert all(later < earlier for earlier, later in itertools.pairwise(gains))
    assert drift.covariance[BIAS, BIAS] < 0.5 * before[BIAS, BIAS]
    assert drift.covariance[HEADING, HEADING] == before[HEADING, HEADING]


def test_a_gap_opens_the_position_by_what_a_person_can_walk():
    drift = DriftModel(0.01)
    drift.gap(3.0)
    assert drift.covariance[X, X] == drift.covariance[Y, Y] == pytest.approx((3.0 * WALKING_SPEED_M_S) ** 2)
