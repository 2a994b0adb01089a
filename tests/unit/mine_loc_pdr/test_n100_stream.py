"""The N100's byte stream to measurements: device time, ROS axes, and orientation only where it belongs."""

import math

import numpy as np
import pytest

from mine_loc_core import quaternion
from mine_loc_core.device_clock import DeviceClock
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S, NS_PER_US
from mine_loc_pdr.fdilink import AhrsFrame, ImuFrame, RawSensorsFrame, encode
from mine_loc_pdr.n100_stream import N100Stream

START_NS = 1_700_000_000 * NS_PER_S
GYRO, FORCE, FIELD = (0.1, 0.2, 0.5), (0.0, 0.0, -9.81), (200.0, -30.0, 400.0)
NORTH = (1.0, 0.0, 0.0, 0.0)


def imu(time_us, gyro=GYRO, force=FORCE):
    return ImuFrame(gyro, force, FIELD, 25.5, 99000.0, 26.0, time_us)


def ahrs(time_us, orientation=NORTH):
    return AhrsFrame((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), orientation, time_us)


def raw():
    return RawSensorsFrame(FORCE, GYRO, FIELD, 25.5, 101325.0, 25.5)


def make_stream(**options):
    return N100Stream(DeviceClock(1e-6, 64, **options))


def feed(stream, *frames, delay_ns=2 * NS_PER_MS, arrival_ns=None):
    """Feed frames, each arriving `delay_ns` after its device time, and return the measurements."""
    found = []
    for serial, frame in enumerate(frames):
        time_us = getattr(frame, "timestamp_us", 0)
        arrival = START_NS + time_us * NS_PER_US + delay_ns if arrival_ns is None else arrival_ns
        found += stream.feed(arrival, encode(frame, serial % 256))
    return found


def test_a_sample_is_in_ros_axes_and_units():
    (m,) = feed(make_stream(), imu(1000))
    assert m.rate_rad_s == pytest.approx((0.1, -0.2, -0.5))
    assert m.force_m_s2 == pytest.approx((0.0, 0.0, 9.81))
    assert m.field_t == pytest.approx((2e-5, 3e-6, -4e-5))
    assert m.pressure_pa == 99000.0


def test_stamps_keep_the_spacing_of_the_device_through_a_stall_and_burst():
    stream = make_stream()
    steady = feed(stream, *(imu(k * 10_000) for k in range(100)))
    burst_ns = START_NS + 1_300 * NS_PER_MS
    burst = feed(stream, *(imu(k * 10_000) for k in range(100, 130)), arrival_ns=burst_ns)
    stamps = np.array([m.stamp_ns for m in steady + burst])
    np.testing.assert_allclose(np.diff(stamps), 10 * NS_PER_MS, atol=NS_PER_US)


def test_stamping_on_arrival_can_be_asked_for():
    (m,) = feed(make_stream(bypass=True), imu(1000), arrival_ns=START_NS)
    assert m.stamp_ns == START_NS


def test_orientation_of_the_same_instant_is_taken():
    measurements = feed(make_stream(), imu(0), ahrs(10_000), imu(10_000))
    assert measurements[0].orientation is None
    yaw_rad = quaternion.to_euler_zyx(measurements[1].orientation)[2]
    assert yaw_rad == pytest.approx(math.pi / 2)


def test_orientation_half_a_period_old_is_carried_on_by_the_gyro():
    (_, m) = feed(make_stream(), imu(0, gyro=(0, 0, 2.0)), ahrs(5_000), imu(10_000, gyro=(0, 0, 2.0)))
    clockwise_rad = 2.0 * 0.005
    assert quaternion.to_euler_zyx(m.orientation)[2] == pytest.approx(math.pi / 2 - clockwise_rad, abs=1e-6)


@pytest.mark.parametrize("ahrs_us", [4_999, 0, -50_000, 15_001, 10**9])
def test_orientation_farther_than_half_a_period_is_not_taken(ahrs_us):
    assert feed(make_stream(), imu(0), ahrs(ahrs_us), imu(10_000))[1].orientation is None


def test_after_a_pause_the_period_is_not_known_and_no_orientation_taken():
    assert feed(make_stream(), imu(0), ahrs(900_000), imu(1_000_000))[1].orientation is None


def test_a_reconnection_forgets_orientation_and_partial_frame():
    stream = make_stream()
    feed(stream, imu(0), ahrs(10_000))
    stream.feed(START_NS, encode(imu(5), 9)[:30])
    stream.reconnected()
    assert feed(stream, imu(10_000))[0].orientation is None
    assert stream.decoder.losses["skipped_bytes"] == 30


def test_raw_sensors_are_stamped_on_arrival_while_nothing_calibrated_comes():
    stream = make_stream()
    (m,) = feed(stream, raw(), arrival_ns=START_NS)
    assert m.stamp_ns == START_NS
    assert m.rate_rad_s == pytest.approx((0.1, -0.2, -0.5))
    assert m.pressure_pa is None
    assert len(feed(stream, imu(0), raw(), arrival_ns=START_NS + 1)) == 1
    assert len(feed(stream, raw(), arrival_ns=START_NS + 1 + NS_PER_S)) == 1


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_values_that_are_not_finite_are_counted_and_dropped(bad):
    stream = make_stream()
    assert feed(stream, imu(0, gyro=(bad, 0, 0)), imu(10_000, force=(0, bad, 0))) == []
    feed(stream, ahrs(0, orientation=(bad, 0, 0, 0)), ahrs(0, orientation=(0.0, 0.0, 0.0, 0.0)))
    assert stream.faults == {"not_finite": 4}


def test_a_new_clock_maps_device_time_anew_after_ros_time_jumped():
    stream = make_stream()
    feed(stream, *(imu(k * 10_000) for k in range(100)))
    stream.restart_clock(DeviceClock(1e-6, 64))
    (m,) = feed(stream, imu(1_000_000), arrival_ns=START_NS - 3600 * NS_PER_S)
    assert m.stamp_ns == START_NS - 3600 * NS_PER_S
