"""The N100's axes against a pair of frames captured from hardware: one identity catches every frame mistake."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from mine_loc_core import quaternion
from mine_loc_pdr.fdilink import ImuFrame
from mine_loc_pdr.n100_axes import enu_flu_from_ned_frd, field_tesla, flu_from_frd, pressure_pa, yaw_from_heading

ORIENTATION = (-0.15401509, 0.01277107, 0.50925660, 0.84662509)
HEADING_RAD = 3.39615560
FORCE = (-1.71206212, -8.41688156, -4.73239422)
angles = st.floats(-3.0, 3.0)


def test_the_captured_specific_force_points_up_in_east_north_up():
    force_enu = quaternion.rotate(enu_flu_from_ned_frd(ORIENTATION), flu_from_frd(FORCE))
    assert_allclose(force_enu, (-0.023, -0.034, 9.80657), atol=1e-3)


def test_the_captured_orientation_reads_in_ros_conventions():
    q = enu_flu_from_ned_frd(ORIENTATION)
    assert_allclose(q, (0.48974922, 0.36912930, -0.35106829, -0.70755946), atol=1e-7)
    yaw_rad = quaternion.to_euler_zyx(q)[2]
    assert math.degrees(yaw_rad) == pytest.approx(-104.5854, abs=1e-3)
    assert yaw_from_heading(HEADING_RAD) == pytest.approx(yaw_rad, abs=1e-6)


def test_gravity_reads_plus_z_when_level():
    assert flu_from_frd((0.0, 0.0, -9.81)) == (0.0, 0.0, 9.81)


def test_heading_north_is_yaw_ninety_degrees():
    assert yaw_from_heading(0.0) == pytest.approx(math.pi / 2)
    assert yaw_from_heading(math.pi / 2) == pytest.approx(0.0)
    assert yaw_from_heading(math.pi) == pytest.approx(-math.pi / 2)


@given(angles, st.floats(-1.5, 1.5), angles, st.tuples(angles, angles, angles))
def test_both_descriptions_turn_a_body_vector_into_the_same_world_vector(roll, pitch, yaw, vector_frd):
    ned_frd = quaternion.from_euler_zyx(roll, pitch, yaw)
    north, east, down = quaternion.rotate(ned_frd, vector_frd)
    enu = quaternion.rotate(enu_flu_from_ned_frd(tuple(ned_frd)), flu_from_frd(vector_frd))
    assert_allclose(enu, (east, north, -down), atol=1e-12)


@given(st.tuples(angles, angles, angles, angles))
def test_conversions_are_their_own_inverse(q):
    assert_allclose(enu_flu_from_ned_frd(enu_flu_from_ned_frd(q)), q, atol=1e-12)
    assert flu_from_frd(flu_from_frd(q[:3])) == q[:3]


def test_milligauss_become_tesla():
    assert_allclose(field_tesla((500.0, 200.0, -100.0)), (5e-5, -2e-5, 1e-5))


@pytest.mark.parametrize(
    ("pressure", "its_temperature", "expected"),
    [(101325.0, 25.5, None), (101325.0, 26.0, 101325.0), (99000.0, 25.5, 99000.0)],
)
def test_a_standard_atmosphere_at_the_sensor_temperature_means_no_barometer(pressure, its_temperature, expected):
    zero = (0.0, 0.0, 0.0)
    assert pressure_pa(ImuFrame(zero, zero, zero, 25.5, pressure, its_temperature, 0)) == expected


def test_the_orientation_stays_a_unit_quaternion():
    assert np.linalg.norm(enu_flu_from_ned_frd(ORIENTATION)) == pytest.approx(np.linalg.norm(ORIENTATION))
