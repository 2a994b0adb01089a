"""The arithmetic of velocity changes against the textbook: Kalman's update with a Jacobian from differences."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from walks import is_covariance

from mine_loc_fusion import inertial_kernel as kernel
from mine_loc_fusion.inertial_kernel import COSINE, SINE, VELOCITY, inertial_states
from mine_loc_fusion.step_kernel import OWN_STATES, YAW

SEEDS = st.integers(0, 2**32 - 1)
DIMENSIONS = st.sampled_from([2, 3])
INTERVAL_S, VARIANCE = 0.1, 1e-4
SDS, TIMES = np.array([0.2, 0.2, 0.1]), np.array([5.0, 5.0, 1000.0])


def state(seed, dimensions, links=3):
    """A state with a full covariance, and where the biases of links begin."""
    rng = np.random.default_rng(seed)
    first_link = 2 * dimensions + 1 + inertial_states(dimensions) + OWN_STATES
    root = rng.normal(0.0, 0.05, (first_link + links, first_link + links))
    x = rng.normal(0.0, 0.3, first_link + links)
    x[first_link - OWN_STATES + YAW] = rng.uniform(-math.pi, math.pi)
    return x, root @ root.T + 1e-4 * np.eye(len(x)), first_link


def innovation(x, dimensions, first_link, change, axis, *, yaw_known):
    """What a component of the change says beyond what the state has."""
    d, own = dimensions, 2 * dimensions + 1
    yaw = x[first_link - OWN_STATES + YAW]
    c, s = (math.cos(yaw), math.sin(yaw)) if yaw_known else (x[own + COSINE], x[own + SINE])
    seen = (c * change[0] - s * change[1], s * change[0] + c * change[1], change[2])[axis]
    expected = x[d + axis] - x[own + VELOCITY + axis]
    return seen + INTERVAL_S * x[own + VELOCITY + d + axis] - expected


def slope(function, x, gap=1e-6):
    return np.array([(function(x + gap * unit) - function(x - gap * unit)) / (2.0 * gap) for unit in np.eye(len(x))])


def textbook(x, P, H, variance, error):
    S = float(H @ P @ H) + variance
    K = P @ H / S
    rest = np.eye(len(x)) - np.outer(K, H)
    return x + K * error, rest @ P @ rest.T + variance * np.outer(K, K), error**2 / S


def take(x, P, dimensions, first_link, change, *, yaw_known, gate=math.inf):
    return kernel.take_velocity_change(
        x, P, dimensions, first_link, int(yaw_known), np.asarray(change, float), INTERVAL_S, VARIANCE, gate
    )


@settings(max_examples=40)
@given(SEEDS, DIMENSIONS, st.booleans())
def test_a_change_is_the_textbook_s_update_component_by_component(seed, dimensions, yaw_known):
    x, P, first_link = state(seed, dimensions)
    change = np.random.default_rng(seed).normal(0.0, 0.3, 3)
    wanted_x, wanted_P, wanted_d2 = x.copy(), P.copy(), 0.0
    for axis in range(dimensions):
        error = lambda s, axis=axis: innovation(s, dimensions, first_link, change, axis, yaw_known=yaw_known)  # noqa: E731
        H = -slope(error, wanted_x)
        wanted_x, wanted_P, d2 = textbook(wanted_x, wanted_P, H, VARIANCE, error(wanted_x))
        wanted_d2 += d2
    assert take(x, P, dimensions, first_link, change, yaw_known=yaw_known) == pytest.approx(wanted_d2, rel=1e-4)
    assert x == pytest.approx(wanted_x, rel=1e-5, abs=1e-6)
    assert pytest.approx(wanted_P, rel=1e-4, abs=1e-7) == P
    assert is_covariance(P)


@given(SEEDS, DIMENSIONS, st.booleans())
@settings(max_examples=20)
def test_beyond_the_gate_nothing_changes(seed, dimensions, yaw_known):
    x, P, first_link = state(seed, dimensions)
    x[dimensions] += 50.0
    before = x.copy(), P.copy()
    assert take(x, P, dimensions, first_link, (0.1, 0.2, 0.3), yaw_known=yaw_known, gate=20.0) > 20.0
    assert (x == before[0]).all()
    assert (before[1] == P).all()


@given(SEEDS, DIMENSIONS)
@settings(max_examples=20)
def test_a_velocity_that_is_remembered_is_the_velocity_with_all_its_covariances(seed, dimensions):
    x, P, _ = state(seed, dimensions)
    kernel.remember_velocity(x, P, dimensions)
    clone, velocity = (slice(first, first + dimensions) for first in (2 * dimensions + 1 + VELOCITY, dimensions))
    assert x[clone].tolist() == x[velocity].tolist()
    assert P[clone].tolist() == P[velocity].tolist()
    assert P[clone, clone].tolist() == P[velocity, velocity].tolist()
    assert is_covariance(P)


@given(SEEDS, DIMENSIONS)
@settings(max_examples=20)
def test_a_yaw_that_is_forgotten_is_as_likely_any(seed, dimensions):
    x, P, _ = state(seed, dimensions)
    rest = P.copy()
    kernel.forget_yaw(x, P, dimensions)
    first = 2 * dimensions + 1
    pair = [first + COSINE, first + SINE]
    assert x[pair].tolist() == [0.0, 0.0]
    assert P[np.ix_(pair, pair)].tolist() == [[0.5, 0.0], [0.0, 0.5]]
    others = np.delete(np.arange(len(x)), pair)
    assert (P[np.ix_(others, others)] == rest[np.ix_(others, others)]).all()
    assert not P[np.ix_(pair, others)].any()


@given(SEEDS, DIMENSIONS)
@settings(max_examples=20)
def test_the_error_of_acceleration_comes_to_rest_at_how_large_it_is(seed, dimensions):
    x, P, _ = state(seed, dimensions)
    kernel.pass_time(x, P, dimensions, 1e6, SDS, TIMES)
    first = 2 * dimensions + 1 + VELOCITY + dimensions
    assert x[first : first + dimensions] == pytest.approx([0.0] * dimensions)
    assert np.diag(P)[first : first + dimensions] == pytest.approx(SDS[:dimensions] ** 2)
    assert is_covariance(P)


@given(SEEDS, DIMENSIONS)
@settings(max_examples=20)
def test_the_yaw_that_is_settled_is_the_angle_with_the_covariance_of_its_linearisation(seed, dimensions):
    x, P, first_link = state(seed, dimensions)
    own, yaw = 2 * dimensions + 1, first_link - OWN_STATES + YAW
    x[own + COSINE], x[own + SINE] = 0.6, -0.9
    J = np.eye(len(x))
    J[yaw] = slope(lambda s: math.atan2(s[own + SINE], s[own + COSINE]), x)
    wanted = J @ P @ J.T
    kernel.settle_yaw(x, P, dimensions, first_link)
    assert x[yaw] == pytest.approx(math.atan2(-0.9, 0.6))
    assert pytest.approx(wanted, rel=1e-5, abs=1e-7) == P
