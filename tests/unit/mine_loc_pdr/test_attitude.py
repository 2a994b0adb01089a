"""The attitude filter: level by gravity, turned by the gyro, however the IMU is worn."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from mine_loc_core import quaternion
from mine_loc_pdr.attitude import STANDARD_GRAVITY_M_S2, AttitudeFilter

DT_S = 0.01
GRAVITY = np.array((0.0, 0.0, STANDARD_GRAVITY_M_S2))
angles = st.floats(-3.0, 3.0)
mountings = st.builds(quaternion.from_euler_zyx, angles, st.floats(-1.4, 1.4), angles)


def turn(attitude, mounting, rate_base, seconds, force_base=GRAVITY):
    """Let a body turn at `rate_base` (base_link axes) with the IMU mounted as base_link←imu `mounting`."""
    imu_from_base = quaternion.conjugate(mounting)
    rate = tuple(quaternion.rotate(imu_from_base, rate_base))
    force = tuple(quaternion.rotate(imu_from_base, force_base))
    for _ in range(round(seconds / DT_S)):
        attitude.update(DT_S, rate, force)


def started(mounting):
    return AttitudeFilter(tuple(quaternion.rotate(quaternion.conjugate(mounting), GRAVITY)))


@given(mountings)
def test_starts_upright_and_facing_along_odom_x(mounting):
    attitude = started(mounting)
    up = quaternion.rotate(attitude.orientation_imu, quaternion.rotate(quaternion.conjugate(mounting), GRAVITY))
    assert_allclose(up, GRAVITY, atol=1e-9)
    up_imu = quaternion.rotate(quaternion.conjugate(attitude.orientation_imu), (0, 0, 1))
    assert_allclose(up_imu, attitude.up_imu, atol=1e-12)
    assert attitude.heading_rad == pytest.approx(0.0, abs=1e-9)


@given(mountings, st.floats(-3.0, 3.0))
def test_a_turn_of_the_body_turns_the_heading_as_much_however_the_imu_is_worn(mounting, angle):
    attitude = started(mounting)
    turn(attitude, mounting, (0.0, 0.0, angle / 2.0), 2.0)
    assert attitude.heading_rad == pytest.approx(angle, abs=1e-6)


def test_counter_clockwise_is_positive():
    attitude = AttitudeFilter((0.0, 0.0, 9.81))
    turn(attitude, (1, 0, 0, 0), (0.0, 0.0, 1.0), 1.0)
    assert attitude.heading_rad == pytest.approx(1.0, abs=1e-6)
    assert_allclose(attitude.facing, (math.cos(1.0), math.sin(1.0)), atol=1e-6)


def test_facing_is_where_the_stated_front_of_the_body_points():
    attitude = AttitudeFilter((0.0, 9.81, 0.1), forward_imu=(0.0, 0.0, 1.0))
    assert attitude.heading_rad == pytest.approx(0.0, abs=1e-9)
    front = quaternion.rotate(attitude.orientation_imu, (0.0, 0.0, 1.0))
    assert front[0] == pytest.approx(1.0, abs=1e-3)


def test_an_upside_down_start_is_still_upright():
    attitude = AttitudeFilter((0.0, 0.0, -9.81))
    assert_allclose(attitude.up_imu, (0.0, 0.0, -1.0), atol=1e-12)


def test_without_gravity_there_is_no_start():
    with pytest.raises(ValueError, match="gravity"):
        AttitudeFilter((0.0, 0.0, 0.0))


def test_gravity_takes_a_wrong_tilt_back_within_a_few_time_constants():
    attitude = AttitudeFilter((2.0, 1.0, 9.5))
    turn(attitude, (1, 0, 0, 0), (0.0, 0.0, 0.0), 25.0)
    assert_allclose(attitude.up_imu, (0.0, 0.0, 1.0), atol=5e-3)


def test_a_gyro_bias_of_half_a_degree_a_second_tilts_the_horizon_by_less_than_three_degrees():
    attitude = AttitudeFilter((0.0, 0.0, 9.81))
    turn(attitude, (1, 0, 0, 0), (math.radians(0.5), 0.0, 0.0), 60.0)
    tilt_rad = math.acos(attitude.up_imu[2])
    assert math.radians(2.0) < tilt_rad < math.radians(3.0)


def test_the_known_bias_is_taken_off():
    attitude = AttitudeFilter((0.0, 0.0, 9.81))
    attitude.bias_rad_s = (0.0, 0.0, 0.02)
    turn(attitude, (1, 0, 0, 0), (0.0, 0.0, 0.02), 10.0)
    assert attitude.heading_rad == pytest.approx(0.0, abs=1e-9)


def test_a_knock_tips_the_horizon_by_less_than_two_degrees():
    attitude = AttitudeFilter((0.0, 0.0, 9.81))
    turn(attitude, (1, 0, 0, 0), (0.0, 0.0, 0.0), 0.05, force_base=(900.0, 0.0, 9.81))
    assert math.acos(attitude.up_imu[2]) < math.radians(2.0)


@given(st.lists(st.tuples(*[st.floats(-30, 30)] * 3), max_size=50))
def test_the_quaternion_stays_a_unit_one(rates):
    attitude = AttitudeFilter((0.0, 0.0, 9.81))
    for rate in rates:
        attitude.update(0.02, rate, (0.3, -0.2, 9.7))
    assert np.linalg.norm(attitude.orientation_imu) == pytest.approx(1.0, abs=1e-12)
