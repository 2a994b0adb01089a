"""Dilution of precision and the small linear algebra, against numpy and the formulae."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_uwb.geometry import direction, gdop, inverse_information, solve_symmetric

SEEDS = st.integers(0, 2**32 - 1)


def jacobian(position, anchors, height_m):
    place = position if len(position) == 3 else np.append(position, height_m)
    offsets = place - anchors
    return (offsets / np.linalg.norm(offsets, axis=1)[:, None])[:, : len(position)]


@settings(max_examples=50)
@given(SEEDS, st.integers(1, 6), st.sampled_from([1e-6, 1.0, 1e6]))
def test_a_positive_definite_system_is_solved_as_numpy_does(seed, size, scale):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size)) + 3.0 * np.eye(size)
    A, b = scale * root @ root.T, rng.normal(size=size)
    solution = b.copy()
    assert solve_symmetric(A.copy(), solution)
    assert solution == pytest.approx(np.linalg.solve(A, b), rel=1e-6, abs=1e-9 / scale)


@pytest.mark.parametrize(
    "A",
    [np.zeros((2, 2)), np.ones((2, 2)), -np.eye(3), np.diag([1.0, -1e-3]), np.array([[1.0, 2.0], [2.0, 1.0]])],
    ids=["nothing", "rank 1", "negative", "one negative", "indefinite"],
)
def test_a_system_that_is_not_positive_definite_is_refused_and_b_is_left_alone(A):
    b = np.arange(1.0, len(A) + 1.0)
    assert not solve_symmetric(A.copy(), b)
    assert b.tolist() == np.arange(1.0, len(A) + 1.0).tolist()


def test_nan_in_a_system_is_refused():
    assert not solve_symmetric(np.full((2, 2), math.nan), np.ones(2))


def test_distance_is_slant_and_its_gradient_that_of_the_solved_coordinates():
    unit = np.empty(2)
    assert direction(np.array([3.0, 0.0]), np.array([0.0, 0.0, 5.0]), 1.0, unit) == pytest.approx(5.0)
    assert unit == pytest.approx([0.6, 0.0])
    unit = np.empty(3)
    assert direction(np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 5.0]), math.nan, unit) == pytest.approx(4.0)
    assert unit == pytest.approx([0.0, 0.0, -1.0])


def test_a_position_on_an_anchor_gives_a_finite_direction():
    unit = np.empty(3)
    assert 0.0 <= direction(np.ones(3), np.ones(3), math.nan, unit) < 1e-3
    assert np.isfinite(unit).all()


@settings(max_examples=50)
@given(SEEDS, st.integers(4, 12), st.sampled_from([2, 3]))
def test_gdop_is_the_root_of_the_trace_of_the_inverse_information(seed, count, dimensions):
    rng = np.random.default_rng(seed)
    anchors, position = rng.uniform(0, 30, (count, 3)), rng.uniform(0, 30, dimensions)
    J = jacobian(position, anchors, 1.2)
    expected = math.sqrt(np.trace(np.linalg.inv(J.T @ J)))
    assert gdop(position, anchors, np.ones(count), 1.2) == pytest.approx(expected, rel=1e-5)


def test_four_anchors_in_the_four_directions_dilute_by_one():
    anchors = np.array([[5.0, 0, 1], [-5, 0, 1], [0, 5, 1], [0, -5, 1]])
    assert gdop(np.zeros(2), anchors, np.ones(4), 1.0) == pytest.approx(1.0)


@pytest.mark.parametrize("yaw", [0.0, 0.7, math.pi / 2])
def test_gdop_on_the_line_of_all_anchors_is_infinite(yaw):
    along = np.array([math.cos(yaw), math.sin(yaw), 0.0])
    anchors = np.outer([0.0, 7.0, 13.0, 31.0], along) + np.array([3.0, 4.0, 1.0])
    assert gdop(20.0 * along[:2] + np.array([3.0, 4.0]), anchors, np.ones(4), 1.0) == math.inf


def test_an_anchor_of_weight_0_does_not_count():
    anchors = np.array([[5.0, 0, 1], [0, 5, 1], [-4, -4, 1]])
    position = np.zeros(2)
    assert gdop(position, anchors, np.array([1.0, 1.0, 0.0]), 1.0) == gdop(position, anchors[:2], np.ones(2), 1.0)
    assert gdop(position, anchors, np.array([1.0, 0.0, 0.0]), 1.0) == math.inf
    assert gdop(position, anchors, np.zeros(3), 1.0) == math.inf


@settings(max_examples=30)
@given(SEEDS, st.sampled_from([2, 3]))
def test_inverse_information_is_that_of_the_weighted_jacobian_and_symmetric(seed, dimensions):
    rng = np.random.default_rng(seed)
    anchors, position, weights = rng.uniform(0, 30, (6, 3)), rng.uniform(0, 30, dimensions), rng.uniform(0.1, 9.0, 6)
    inverse = np.empty((dimensions, dimensions))
    assert inverse_information(position, anchors, weights, 1.2, inverse)
    J = jacobian(position, anchors, 1.2)
    expected = np.linalg.inv(J.T @ (weights[:, None] * J))
    assert inverse == pytest.approx(expected, rel=1e-5, abs=1e-9)
    assert inverse == pytest.approx(inverse.T, rel=1e-9, abs=1e-12)
