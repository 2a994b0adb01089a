"""The arithmetic of steps against the textbook: Kalman's update with a Jacobian from differences."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from walks import is_covariance

from mine_loc_fusion import step_kernel
from mine_loc_fusion.step_kernel import OWN_STATES, SCALE, STRIKE_X, YAW

SEEDS = st.integers(0, 2**32 - 1)
DIMENSIONS = st.sampled_from([2, 3])
ALONG_M2, ACROSS_M2 = 0.06**2, 0.04**2


def state(seed, dimensions, links=3):
    """A state with a full covariance, and where the biases of links begin."""
    rng = np.random.default_rng(seed)
    first_link = 2 * dimensions + 1 + OWN_STATES
    root = rng.normal(0.0, 0.1, (first_link + links, first_link + links))
    x = rng.normal(0.0, 0.3, first_link + links)
    x[first_link - OWN_STATES + YAW] = rng.uniform(-math.pi, math.pi)
    return x, root @ root.T + 1e-4 * np.eye(len(x)), first_link


def way_seen(x, first_link, length_m, heading_rad):
    """Where the step says the person is from the strike, minus where the state has it: nothing when they agree."""
    own = first_link - OWN_STATES
    angle, way_m = heading_rad + x[own + YAW], (1.0 + x[own + SCALE]) * length_m
    strike = own + STRIKE_X
    return np.array([way_m * math.cos(angle), way_m * math.sin(angle)]) - x[:2] + x[strike : strike + 2]


def jacobian(function, x, gap=1e-6):
    columns = [(function(x + gap * unit) - function(x - gap * unit)) / (2.0 * gap) for unit in np.eye(len(x))]
    return np.column_stack(columns)


def textbook(x, P, H, R, innovation):
    S = H @ P @ H.T + R
    K = P @ H.T @ np.linalg.inv(S)
    rest = np.eye(len(x)) - K @ H
    return x + K @ innovation, rest @ P @ rest.T + K @ R @ K.T, float(innovation @ np.linalg.inv(S) @ innovation)


@settings(max_examples=40)
@given(SEEDS, DIMENSIONS, st.floats(0.1, 2.0), st.floats(-math.pi, math.pi))
def test_a_step_is_the_textbook_s_update_by_the_way_since_the_strike(seed, dimensions, length_m, heading_rad):
    x, P, first_link = state(seed, dimensions)
    angle = heading_rad + x[first_link - OWN_STATES + YAW]
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    R = turn @ np.diag([ALONG_M2, ACROSS_M2]) @ turn.T
    H = -jacobian(lambda s: way_seen(s, first_link, length_m, heading_rad), x)
    wanted_x, wanted_P, wanted_d2 = textbook(x, P, H, R, way_seen(x, first_link, length_m, heading_rad))
    d2 = step_kernel.take_step(x, P, first_link, length_m, heading_rad, ALONG_M2, ACROSS_M2, math.inf)
    assert d2 == pytest.approx(wanted_d2, rel=1e-5)
    assert x == pytest.approx(wanted_x, rel=1e-6, abs=1e-7)
    assert pytest.approx(wanted_P, rel=1e-6, abs=1e-8) == P


@settings(max_examples=40)
@given(SEEDS, DIMENSIONS, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_a_place_is_the_textbook_s_update_by_a_horizontal_position(seed, dimensions, east_m, north_m):
    x, P, _ = state(seed, dimensions)
    place_m, R = np.array([east_m, north_m]), np.array([[0.3, 0.1], [0.1, 0.2]])
    wanted_x, wanted_P, wanted_d2 = textbook(x, P, np.eye(2, len(x)), R, place_m - x[:2])
    assert step_kernel.take_place(x, P, place_m, R, math.inf) == pytest.approx(wanted_d2, rel=1e-9)
    assert x == pytest.approx(wanted_x, rel=1e-9, abs=1e-12)
    assert pytest.approx(wanted_P, rel=1e-9, abs=1e-12) == P


@given(SEEDS, DIMENSIONS)
def test_a_strike_remembered_is_the_position_in_everything_that_is_known_of_it(seed, dimensions):
    x, P, first_link = state(seed, dimensions)
    before_x, before_P = x.copy(), P.copy()
    step_kernel.remember_strike(x, P, first_link)
    strike = first_link - OWN_STATES + STRIKE_X
    clone = [strike, strike + 1]
    others = [i for i in range(len(x)) if i not in clone]
    assert x[clone].tolist() == x[:2].tolist() == before_x[:2].tolist()
    assert np.array_equal(P[np.ix_(clone, clone)], before_P[:2, :2])
    assert np.array_equal(P[np.ix_(clone, others)], before_P[:2, others])
    assert np.array_equal(P[np.ix_(others, clone)], before_P[others, :2])
    assert np.array_equal(P[np.ix_(others, others)], before_P[np.ix_(others, others)])
    assert np.array_equal(x[others], before_x[others])
    difference = np.zeros((2, len(x)))
    difference[[0, 1], [0, 1]], difference[[0, 1], clone] = 1.0, -1.0
    assert np.abs(difference @ P @ difference.T).max() < 1e-12


@pytest.mark.parametrize("gate", [0.0, 5.0, 13.0])
def test_beyond_the_gate_nothing_changes_and_the_distance_is_told(gate):
    x, P, first_link = state(1, 2)
    kept_x, kept_P = x.copy(), P.copy()
    far = way_seen(x, first_link, 0.0, 0.0) - x[:2] + [50.0, 0.0]
    assert step_kernel.take_place(x, P, x[:2] + far, np.eye(2), gate) > gate
    assert step_kernel.take_step(x, P, first_link, 30.0, 0.0, ALONG_M2, ACROSS_M2, gate) > gate
    assert np.array_equal(x, kept_x)
    assert np.array_equal(P, kept_P)


def test_time_adds_to_the_yaw_and_to_the_scale_alone():
    x, P, first_link = state(2, 3)
    before = P.copy()
    step_kernel.drift(P, first_link, 0.01, 0.002)
    own = first_link - OWN_STATES
    wanted = np.zeros_like(P)
    wanted[own + YAW, own + YAW], wanted[own + SCALE, own + SCALE] = 0.01, 0.002
    assert P - before == pytest.approx(wanted, abs=1e-15)
    assert len(x) == len(P)


@settings(max_examples=20)
@given(SEEDS, DIMENSIONS)
def test_the_covariance_stays_one_over_a_thousand_steps_and_places(seed, dimensions):
    x, P, first_link = state(seed, dimensions)
    rng = np.random.default_rng(seed)
    for number in range(1000):
        P[:2, :2] += 0.01 * np.eye(2)
        if number % 7 == 0:
            step_kernel.take_place(x, P, x[:2] + rng.normal(0.0, 0.1, 2), 10.0 ** rng.uniform(-4, 4) * np.eye(2), 18.0)
        step_kernel.take_step(
            x, P, first_link, rng.uniform(0.0, 2.0), rng.uniform(-9.0, 9.0), ALONG_M2, ACROSS_M2, 18.0
        )
        step_kernel.remember_strike(x, P, first_link)
        step_kernel.drift(P, first_link, 1e-5, 1e-6)
    assert np.array_equal(P, P.T)
    assert is_covariance(P)
    assert np.isfinite(x).all()
