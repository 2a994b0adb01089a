"""FDILink against frames captured from hardware, independent CRC implementations and every kind of damage."""

import random

import crccheck
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_pdr.fdilink import (
    AHRS_ROW,
    IMU_ROW,
    AhrsFrame,
    FdilinkDecoder,
    ImuFrame,
    RawSensorsFrame,
    ahrs_frames,
    crc8,
    crc16,
    encode,
    encode_payload,
    imu_frames,
)

CAPTURED_IMU = bytes.fromhex(
    "fc4038e97c991722f206bba7d9f23a3e0c39bbda24dbbf8cab06c1c66f97c0382ed6c276469444e2be3ac473fd1e4280e6c54773fd1e42"
    "2ee9d42600000000fd"
)
CAPTURED_AHRS = bytes.fromhex(
    "fc4130ea438013 6b4f00bb72b3cf3a5706dbba50af873f6dc237be9d5a594022b61dbebd3d513ca45e023f6cbc583fb6fcd42600000000fd"
)
MADE_IMU = bytes.fromhex(
    "fc4038078a73350ad7233c0ad7a3bc8fc2f53ccdcccc3dcdcc4cbecdcc1cc1000048430000f0c10000c8430000cc4180e6c5470000d041"
    "87d6120000000000fd"
)
MADE_AHRS = bytes.fromhex(
    "fc41300757fbd40ad7233c0ad7a3bc8fc2f53ccdcccc3dcdcc4cbe9a99993e0000803f00000000000000000000000087d6120000000000fd"
)
MADE_RAW = bytes.fromhex(
    "fc5830098c6189cdcccc3dcdcc4cbecdcc1cc10ad7233c0ad7a3bc8fc2f53c000048430000f0c10000c8430000cc4180e6c5470000d041fd"
)
ZERO_LENGTH = bytes.fromhex("fc50000146")
GYRO, FORCE, FIELD = (0.01, -0.02, 0.03), (0.1, -0.2, -9.8), (200.0, -30.0, 400.0)

floats = st.floats(width=32, allow_nan=False)
vectors = st.tuples(floats, floats, floats)
times = st.integers(-(2**63), 2**63 - 1)
frames = st.one_of(
    st.builds(ImuFrame, vectors, vectors, vectors, floats, floats, floats, times),
    st.builds(AhrsFrame, vectors, vectors, st.tuples(floats, floats, floats, floats), times),
    st.builds(RawSensorsFrame, vectors, vectors, vectors, floats, floats, floats),
)


def decode(data: bytes, decoder: FdilinkDecoder | None = None) -> list:
    return (decoder or FdilinkDecoder()).feed(data)


def test_the_captured_imu_frame_reads_as_recorded():
    (frame,) = decode(CAPTURED_IMU)
    assert isinstance(frame, ImuFrame)
    assert frame.angular_velocity_rad_s == pytest.approx((-0.00205911, 0.00185280, -0.00282361), abs=1e-8)
    assert frame.specific_force_m_s2 == pytest.approx((-1.71206212, -8.41688156, -4.73239422), abs=1e-7)
    assert frame.magnetic_field_mg == pytest.approx((-107.09027, 1186.20190, -746.98254), abs=1e-4)
    assert frame.temperature_c == frame.pressure_temperature_c == pytest.approx(39.747509, abs=1e-5)
    assert frame.pressure_pa == 101325.0
    assert frame.timestamp_us == 651487534


def test_the_captured_ahrs_frame_reads_as_recorded():
    (frame,) = decode(CAPTURED_AHRS)
    assert isinstance(frame, AhrsFrame)
    assert frame.euler_rate_rad_s == pytest.approx((-0.00195786, 0.00158463, -0.00167103), abs=1e-8)
    assert frame.euler_rad == pytest.approx((1.06003761, -0.17945261, 3.39615560), abs=1e-7)
    assert frame.orientation == pytest.approx((-0.15401509, 0.01277107, 0.50925660, 0.84662509), abs=1e-7)
    assert frame.timestamp_us == 651492534


@pytest.mark.parametrize(
    ("wire", "serial"), [(CAPTURED_IMU, 0xE9), (CAPTURED_AHRS, 0xEA), (MADE_IMU, 7), (MADE_AHRS, 7), (MADE_RAW, 9)]
)
def test_a_decoded_vector_encodes_to_the_same_bytes(wire, serial):
    (frame,) = decode(wire)
    assert encode(frame, serial) == wire


def test_rows_of_an_array_are_payloads():
    imu, ahrs = np.zeros(2, IMU_ROW), np.zeros(2, AHRS_ROW)
    imu["values"], imu["timestamp_us"] = [range(12), range(12, 24)], [7, 8]
    ahrs["values"], ahrs["timestamp_us"] = [range(10), range(10, 20)], [9, 10]
    assert list(imu_frames(imu.tobytes()))[1] == ImuFrame((12, 13, 14), (15, 16, 17), (18, 19, 20), 21, 22, 23, 8)
    assert list(ahrs_frames(ahrs.tobytes()))[1] == AhrsFrame((10, 11, 12), (13, 14, 15), (16, 17, 18, 19), 10)
    for row, kind in ((imu[1], 0x40), (ahrs[1], 0x41)):
        (frame,) = decode(encode_payload(kind, row.tobytes(), 0))
        assert encode(frame, 0) == encode_payload(kind, row.tobytes(), 0)


def test_made_up_values_encode_to_the_published_vectors():
    imu = ImuFrame(GYRO, FORCE, FIELD, 25.5, 101325.0, 26.0, 1234567)
    ahrs = AhrsFrame(GYRO, (0.1, -0.2, 0.3), (1.0, 0.0, 0.0, 0.0), 1234567)
    raw = RawSensorsFrame(FORCE, GYRO, FIELD, 25.5, 101325.0, 26.0)
    assert encode(imu, 7) == MADE_IMU
    assert encode(ahrs, 7) == MADE_AHRS
    assert encode(raw, 9) == MADE_RAW
    assert encode_payload(0x50, b"", 1) == ZERO_LENGTH


def test_raw_sensors_put_acceleration_before_rotation():
    (frame,) = decode(MADE_RAW)
    assert isinstance(frame, RawSensorsFrame)
    assert frame.specific_force_m_s2 == pytest.approx(FORCE, rel=1e-6)
    assert frame.angular_velocity_rad_s == pytest.approx(GYRO, rel=1e-6)


@given(st.binary(max_size=300))
def test_crcs_agree_with_an_independent_implementation(data):
    assert crc8(data) == crccheck.crc.Crc8Maxim.calc(data)
    assert crc16(data) == crccheck.crc.CrcXmodem.calc(data)


def test_crcs_meet_their_catalogue_check_values():
    assert crc8(b"123456789") == 0xA1
    assert crc16(b"123456789") == 0x31C3


@given(st.lists(frames, max_size=6), st.integers(0, 255), st.data())
def test_any_frames_in_any_chunking_come_back_without_loss(sent, serial, data):
    wire = b"".join(encode(frame, (serial + i) % 256) for i, frame in enumerate(sent))
    cuts = sorted(data.draw(st.lists(st.integers(0, len(wire)), max_size=8)))
    decoder = FdilinkDecoder()
    received = [frame for a, b in zip([0, *cuts], [*cuts, len(wire)], strict=True) for frame in decoder.feed(wire[a:b])]
    assert received == sent
    assert not decoder.losses


@pytest.mark.parametrize("bit", range(40))
def test_a_flipped_header_bit_costs_that_frame_alone(bit):
    wire = bytearray(CAPTURED_IMU)
    wire[bit // 8] ^= 1 << bit % 8
    decoder = FdilinkDecoder()
    assert [f.timestamp_us for f in decoder.feed(bytes(wire) + CAPTURED_AHRS)] == [651492534]
    if bit < 8:
        assert decoder.losses["skipped_bytes"] == len(CAPTURED_IMU)
    else:
        assert decoder.losses["crc8"] >= 1  # a CRC byte that became 0xFC is a second false start


@pytest.mark.parametrize("position", range(5, len(CAPTURED_IMU) - 1))
def test_a_flipped_bit_in_crc16_or_payload_costs_that_frame_alone(position):
    for bit in range(8):
        wire = bytearray(CAPTURED_IMU)
        wire[position] ^= 1 << bit
        decoder = FdilinkDecoder()
        assert [f.timestamp_us for f in decoder.feed(bytes(wire) + CAPTURED_AHRS)] == [651492534]
        assert decoder.losses["crc16"] == 1


def test_swapped_crc16_bytes_are_refused():
    wire = bytearray(CAPTURED_IMU)
    wire[5], wire[6] = wire[6], wire[5]
    decoder = FdilinkDecoder()
    assert decoder.feed(bytes(wire)) == []
    assert decoder.losses["crc16"] == 1


def test_a_wrong_trailer_is_refused():
    decoder = FdilinkDecoder()
    assert decoder.feed(CAPTURED_IMU[:-1] + b"\xfe") == []
    assert decoder.losses["trailer"] == 1


def test_a_length_beyond_the_cap_is_refused_at_once():
    header = bytes((0xFC, 0x40, 248, 0))
    decoder = FdilinkDecoder()
    assert len(decoder.feed(header + bytes((crc8(header),)) + CAPTURED_IMU)) == 1
    assert decoder.losses["length"] == 1


def test_a_payload_that_looks_like_a_frame_is_not_taken_for_one():
    decoder = FdilinkDecoder()
    assert decoder.feed(encode_payload(0x5F, CAPTURED_AHRS, 1)) == []
    assert decoder.skipped_types == {0x5F: 1}
    assert not decoder.losses


def test_a_truncated_frame_does_not_take_the_next_good_one_with_it():
    for kept in range(1, len(CAPTURED_IMU)):
        decoder = FdilinkDecoder()
        received = decoder.feed(CAPTURED_IMU[:kept] + CAPTURED_AHRS + MADE_IMU)
        assert [f.timestamp_us for f in received] == [651492534, 1234567]
        assert decoder.losses["skipped_bytes"] == kept


def test_one_byte_at_a_time_gives_the_same_frames():
    decoder = FdilinkDecoder()
    wire = CAPTURED_IMU + CAPTURED_AHRS
    assert [f for byte in wire for f in decoder.feed(bytes((byte,)))] == decode(wire)
    assert not decoder.losses


def test_noise_yields_no_frame_and_a_good_frame_after_it_survives():
    noise = random.Random(1).randbytes(65536)
    decoder = FdilinkDecoder()
    assert decoder.feed(noise) == []
    received = decoder.feed(bytes(256) + CAPTURED_IMU)
    assert [f.timestamp_us for f in received] == [651487534]
    assert decoder.losses["crc8"] > 100
    skipped_frames_bytes = 65536 + 256 - decoder.losses["skipped_bytes"]
    assert skipped_frames_bytes == 5 * decoder.skipped_types.total()


@given(st.binary(max_size=2000))
def test_hostile_bytes_never_raise(data):
    decoder = FdilinkDecoder()
    decoder.feed(data)
    decoder.feed(bytes(256))
    assert [f.timestamp_us for f in decoder.feed(CAPTURED_IMU)] == [651487534]


def test_unknown_types_and_other_lengths_of_known_types_are_skipped_and_counted():
    decoder = FdilinkDecoder()
    wire = encode_payload(0xF0, b"12345", 10) + encode_payload(0x40, bytes(48), 11) + encode_payload(0x50, b"", 12)
    assert decoder.feed(wire) == []
    assert decoder.skipped_types == {0xF0: 1, 0x40: 1, 0x50: 1}
    assert not decoder.losses


def test_a_zero_length_frame_is_five_bytes_long():
    decoder = FdilinkDecoder()
    received = decoder.feed(encode_payload(0x50, b"", 6) + MADE_IMU)
    assert [f.timestamp_us for f in received] == [1234567]
    assert not decoder.losses


def test_idle_trailer_bytes_between_frames_are_passed_over():
    decoder = FdilinkDecoder()
    assert len(decoder.feed(b"\xfd" + CAPTURED_IMU + b"\xfd\xfd" + CAPTURED_AHRS)) == 2
    assert decoder.losses == {"skipped_bytes": 3}


def test_text_replies_between_frames_are_passed_over():
    decoder = FdilinkDecoder()
    assert len(decoder.feed(CAPTURED_IMU + b"*#OK\r\n" + CAPTURED_AHRS)) == 2
    assert decoder.losses == {"skipped_bytes": 6}


@given(st.integers(0, 255), st.integers(0, 254))
def test_a_gap_of_the_shared_serial_number_counts_the_frames_lost(serial, lost):
    (imu,) = decode(MADE_IMU)
    decoder = FdilinkDecoder()
    decoder.feed(encode(imu, serial) + encode_payload(0x53, b"\0\0\0\0", (serial + 1) % 256))
    decoder.feed(encode(imu, (serial + 2 + lost) % 256))
    assert decoder.losses["lost_frames"] == lost


def test_reset_forgets_the_partial_frame_and_the_serial_number():
    decoder = FdilinkDecoder()
    decoder.feed(CAPTURED_IMU + CAPTURED_AHRS[:20])
    decoder.reset()
    assert [f.timestamp_us for f in decoder.feed(MADE_IMU)] == [1234567]
    assert decoder.losses == {"skipped_bytes": 20}


def test_encoding_refuses_what_the_wire_cannot_carry():
    (imu,) = decode(MADE_IMU)
    with pytest.raises(ValueError, match="0 to 255"):
        encode(imu, 256)
    with pytest.raises(ValueError, match="0 to 247"):
        encode_payload(0x50, bytes(248), 0)
    with pytest.raises(ValueError, match="does not fit"):
        encode(ImuFrame((1e39, 0.0, 0.0), FORCE, FIELD, 0.0, 0.0, 0.0, 0), 0)
    with pytest.raises(ValueError, match="does not fit"):
        encode(ImuFrame(GYRO, FORCE, FIELD, 0.0, 0.0, 0.0, 2**63), 0)
