"""Bytes of sensor messages against what the middleware's own code makes of them."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip("rclpy")

import sensor_msgs.msg as messages
from rclpy import serialization
from std_msgs.msg import Header

from mine_loc_core.nodes.conversions import to_time
from mine_loc_pdr.dead_reckoning import FieldSample, ImuSample
from mine_loc_pdr.n100_stream import ImuMeasurement
from mine_loc_pdr.nodes.messages import Covariances, to_imu
from mine_loc_pdr.sensor_cdr import ImuWriter, field_sample, imu_sample

vectors = st.tuples(*[st.floats(-1e3, 1e3)] * 3)
frames = st.text(st.characters(min_codepoint=32, max_codepoint=126), max_size=30)


def imu_message(frame, stamp, rate, force):
    imu = messages.Imu()
    imu.header.frame_id = frame
    imu.header.stamp.sec, imu.header.stamp.nanosec = stamp
    imu.angular_velocity.x, imu.angular_velocity.y, imu.angular_velocity.z = rate
    imu.linear_acceleration.x, imu.linear_acceleration.y, imu.linear_acceleration.z = force
    imu.orientation_covariance[0] = -1.0
    return serialization.serialize_message(imu)


@given(frames, st.tuples(st.integers(0, 2**31 - 1), st.integers(0, 999_999_999)), vectors, vectors)
def test_stamp_rate_and_force_are_those_of_the_message_whatever_its_frame_is_called(frame, stamp, rate, force):
    sample = imu_sample(imu_message(frame, stamp, rate, force))
    assert sample == ImuSample(stamp[0] * 10**9 + stamp[1], rate, force)


@given(frames, st.integers(0, 2**31 * 10**9 - 1), st.none() | st.tuples(*[st.floats(-1.0, 1.0)] * 4), vectors, vectors)
def test_a_written_sample_is_the_message_that_the_middleware_would_write(frame, stamp_ns, orientation, rate, force):
    spreads = [[float(each + place) for place in range(9)] for each in (10, 20, 30)]
    covariances = Covariances(orientation=spreads[0], rate=spreads[1], force=spreads[2], field=9 * [0.0])
    measurement = ImuMeasurement(stamp_ns, rate, force, (0.0, 0.0, 0.0), orientation, None)
    wanted = to_imu(measurement, Header(stamp=to_time(stamp_ns), frame_id=frame), covariances)
    written = ImuWriter(frame, *spreads).write(stamp_ns, orientation, rate, force)
    assert serialization.deserialize_message(written, messages.Imu) == wanted
    assert len(written) == len(serialization.serialize_message(wanted))  # but for padding, whose bytes are anything


@given(frames, vectors)
def test_the_field_is_that_of_the_message(frame, field):
    message = messages.MagneticField()
    message.header.frame_id = frame
    message.header.stamp.sec = 3
    message.magnetic_field.x, message.magnetic_field.y, message.magnetic_field.z = field
    assert field_sample(serialization.serialize_message(message)) == FieldSample(3 * 10**9, field)


def test_a_big_endian_writer_is_understood():
    body = struct.pack(">iII4s", 7, 8, 2, b"a\0") + struct.pack(">37d", *range(37))
    assert imu_sample(b"\x00\x00\x00\x00" + body) == ImuSample(7_000_000_008, (13.0, 14.0, 15.0), (25.0, 26.0, 27.0))


@pytest.mark.parametrize("cut", [0, 3, 15, 40, 200, -90])
def test_what_ends_too_early_is_refused(cut):
    with pytest.raises(ValueError, match="bytes"):
        imu_sample(imu_message("imu_link", (1, 2), (1.0, 2.0, 3.0), (4.0, 5.0, 6.0))[:cut])


def test_another_encoding_is_refused():
    message = bytearray(imu_message("imu_link", (1, 2), (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)))
    message[1] = 0x07
    with pytest.raises(ValueError, match="CDR"):
        imu_sample(bytes(message))
