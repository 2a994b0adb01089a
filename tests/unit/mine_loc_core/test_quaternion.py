"""Quaternions against scipy's rotations, and their algebra."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from mine_loc_core import quaternion

angles = st.floats(-3.1, 3.1)
rotation_vectors = st.tuples(angles, angles, angles).filter(lambda v: np.linalg.norm(v) < 3.1).map(np.array)
vectors = st.tuples(*[st.floats(-100, 100)] * 3).map(np.array)


def scipy_wxyz(rotation: Rotation) -> np.ndarray:
    return np.roll(rotation.as_quat(), 1, axis=-1)


def same_rotation(a, b, tolerance=1e-12):
    return np.allclose(np.abs(np.sum(a * b, axis=-1)), 1.0, atol=tolerance)


@given(rotation_vectors)
def test_a_rotation_vector_gives_the_rotation_scipy_gives(v):
    assert same_rotation(quaternion.from_rotation_vector(v), scipy_wxyz(Rotation.from_rotvec(v)))


def test_no_rotation_is_the_identity():
    assert_allclose(quaternion.from_rotation_vector(np.zeros(3)), (1, 0, 0, 0), atol=0)


@given(rotation_vectors, rotation_vectors, vectors)
def test_a_product_rotates_like_its_factors_one_after_the_other(a, b, v):
    qa, qb = quaternion.from_rotation_vector(a), quaternion.from_rotation_vector(b)
    one_by_one = quaternion.rotate(qa, quaternion.rotate(qb, v))
    assert_allclose(quaternion.rotate(quaternion.product(qa, qb), v), one_by_one, atol=1e-9)
    assert_allclose((Rotation.from_rotvec(a) * Rotation.from_rotvec(b)).apply(v), one_by_one, atol=1e-9)


@given(rotation_vectors, vectors)
def test_the_conjugate_undoes_a_rotation(a, v):
    q = quaternion.from_rotation_vector(a)
    assert_allclose(quaternion.rotate(quaternion.conjugate(q), quaternion.rotate(q, v)), v, atol=1e-9)


@given(angles, st.floats(-1.5, 1.5), angles)
def test_euler_angles_survive_the_round_trip_and_agree_with_scipy(roll, pitch, yaw):
    q = quaternion.from_euler_zyx(roll, pitch, yaw)
    assert same_rotation(q, scipy_wxyz(Rotation.from_euler("ZYX", (yaw, pitch, roll))))
    assert_allclose(quaternion.to_euler_zyx(q), (roll, pitch, yaw), atol=1e-6)


def test_yaw_turns_x_towards_y():
    assert_allclose(quaternion.rotate(quaternion.from_euler_zyx(0, 0, np.pi / 2), (1, 0, 0)), (0, 1, 0), atol=1e-15)


def test_a_nose_dive_does_not_yield_nan():
    q = quaternion.from_euler_zyx(0.0, np.pi / 2, 0.3)
    assert_allclose(quaternion.to_euler_zyx(q * (1 + 1e-12))[1], np.pi / 2, atol=1e-5)


def test_functions_broadcast_over_leading_axes():
    q = quaternion.from_rotation_vector(np.random.default_rng(0).normal(size=(5, 1, 3)))
    v = np.random.default_rng(1).normal(size=(4, 3))
    assert quaternion.rotate(q, v).shape == (5, 4, 3)
    assert quaternion.product(q, quaternion.from_rotation_vector(v)).shape == (5, 4, 4)
    assert_allclose(quaternion.rotate(q, v)[2, 3], quaternion.rotate(q[2, 0], v[3]))


def test_normalise_brings_back_length_one():
    assert_allclose(np.linalg.norm(quaternion.normalise([[1, 2, 3, 4], [0, 0, 0, 1e-3]]), axis=-1), 1.0)
