from binascii import crc_hqx
from math import isnan, nan
from pathlib import Path
from struct import pack

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_uwb.ranging import CirWindow, Range, RangingRound, TdoaBlink, TdoaDifference
from mine_loc_uwb.received_power import Reception, Sfd, powers_dbm
from mine_loc_uwb.wire.mine_loc_frame import MineLocDecoder, encode_frame
from mine_loc_uwb.wire.mine_loc_payload import FrameType, encode_cir, encode_ranges, encode_tdoa

SPECIFICATION = Path(__file__).parents[3] / "docs" / "wire-formats.md"
RECEPTION = Reception(47_700, (1404, 1657, 1179), 42, 10_854, 101, 90, 5, 64, Sfd.STANDARD_8)
ROUND = RangingRound(
    0xDECA01, 0x22, 1000, 123_456_789, (Range(0xA1, 12.345, clock_offset_ppm=-2.5, ticks_offset=1500),), corrected=False
)
BLINK = TdoaBlink(7, 9, 55, 0xA0, -80.25, (TdoaDifference(0xA1, -3.001, -82.0, nan), TdoaDifference(0xA2, nan)))


def window(count=4, start=730, **changes):
    taps = np.arange(-count, count, dtype=np.int16)
    fields = {
        "tag_id": 7,
        "anchor_id": 0xA1,
        "seq": 3,
        "device_ticks": 99,
        "range_m": 4.5,
        "first_path_index": 745.3125,
        "start_index": start,
        "preamble_count": 101,
        "noise_std": 42.0,
        "first_path_amplitude": (1404, 1657, 1179),
        "receive_power_counts": 10_854,
        "channel": 5,
        "prf_mhz": 64,
        "in_phase": taps[:count],
        "quadrature": taps[count:],
    }
    return CirWindow(**fields | changes)


def ranges_frame(number=0, message=ROUND, receptions=(RECEPTION,)):
    return encode_frame(FrameType.RANGES, number, encode_ranges(message, receptions))


def decode(*chunks):
    decoder = MineLocDecoder()
    return [message for chunk in chunks for message in decoder.feed(chunk)], decoder.losses


def same(a, b):
    return repr(a) == repr(b)


@pytest.mark.parametrize(
    "frame",
    [
        ranges_frame(7),
        encode_frame(FrameType.TDOA, 8, encode_tdoa(BLINK)),
        encode_frame(FrameType.CIR, 9, encode_cir(window(2, 744))),
    ],
)
def test_the_examples_of_the_specification_are_what_is_encoded(frame):
    blocks = SPECIFICATION.read_text(encoding="utf-8").split("\n\n")
    examples = [bytes.fromhex(block) for block in blocks if block.startswith("    55 57 ")]
    assert frame in examples


def test_ranges_decode_with_powers_from_the_registers():
    [message], losses = decode(ranges_frame())
    [measured] = message.ranges
    assert (message.tag_id, message.reporter_id, message.seq, message.device_ticks) == (0xDECA01, 0x22, 1000, 123456789)
    assert (measured.anchor_id, measured.range_m, measured.ticks_offset) == (0xA1, 12.345, 1500)
    assert measured.clock_offset_ppm == -2.5
    assert measured.first_path_index == 47_700 / 64
    assert measured.first_path_power_dbm == pytest.approx(-93.968, abs=5e-4)
    assert not losses


def test_what_is_not_reported_is_nan():
    message = RangingRound(1, 0, 0, None, (Range(2, nan),), corrected=True)
    [decoded], _ = decode(ranges_frame(message=message, receptions=()))
    assert same(decoded, message)


def test_differences_of_a_blink_decode():
    messages, losses = decode(encode_frame(FrameType.TDOA, 0, encode_tdoa(BLINK)))
    assert same(messages, [BLINK])
    assert not losses


@pytest.mark.parametrize(("count", "start"), [(0, 0), (128, 730), (1016, 0)])
def test_a_window_of_the_accumulator_decodes(count, start):
    sent = window(count, start)
    [received], losses = decode(encode_frame(FrameType.CIR, 0, encode_cir(sent)))
    np.testing.assert_array_equal(received.in_phase, sent.in_phase)
    np.testing.assert_array_equal(received.quadrature, sent.quadrature)
    assert received.in_phase.dtype == received.quadrature.dtype == np.int16
    for field in CirWindow.__slots__:
        if field not in ("in_phase", "quadrature", "first_path_power_dbm", "receive_power_dbm"):
            assert getattr(received, field) == getattr(sent, field)
    assert received.first_path_power_dbm == pytest.approx(-93.968, abs=5e-4)
    assert not losses


def test_a_window_beyond_the_accumulator_is_refused_both_ways():
    with pytest.raises(ValueError, match="1016"):
        encode_cir(window(10, 1010))
    payload = bytearray(encode_cir(window(10, 1000)))
    payload[52:54] = (1010).to_bytes(2, "little")
    messages, losses = decode(encode_frame(FrameType.CIR, 0, bytes(payload)))
    assert messages == []
    assert losses == {"content": 1}


def test_too_many_ranges_are_refused_both_ways():
    message = RangingRound(1, 0, 0, None, (Range(2, 1.0),) * 65, corrected=False)
    with pytest.raises(ValueError, match="64"):
        encode_ranges(message)
    payload = bytearray(encode_ranges(RangingRound(1, 0, 0, None, (Range(2, 1.0),) * 64, corrected=False)))
    payload[29] = 65
    assert decode(encode_frame(FrameType.RANGES, 0, bytes(payload) + payload[-40:])) == ([], {"content": 1})


@pytest.mark.parametrize("frame_type", list(FrameType))
@pytest.mark.parametrize("payload", [b"", bytes(10), bytes(200)])
def test_a_payload_without_sense_is_counted(frame_type, payload):
    assert decode(encode_frame(frame_type, 0, payload)) == ([], {"content": 1})


def test_unknown_types_and_versions_are_counted_and_skipped():
    newer = bytearray(ranges_frame(1))
    newer[2] = 2
    newer[-2:] = pack("<H", crc_hqx(newer[2:-2], 0))
    messages, losses = decode(encode_frame(99, 0, b"abc"), bytes(newer), ranges_frame(2))
    assert len(messages) == 1
    assert losses == {"unknown_type": 1, "unknown_version": 1}


def test_a_gap_in_the_frame_numbers_counts_the_missing_frames_across_the_wrap():
    messages, losses = decode(ranges_frame(65_534), ranges_frame(1), ranges_frame(2))
    assert len(messages) == 3
    assert losses == {"missing_frames": 2}


def test_a_restarted_device_is_not_taken_for_missing_frames():
    _, losses = decode(ranges_frame(500), ranges_frame(0))
    assert losses == {"restart": 1}


def test_reset_forgets_the_frame_number():
    decoder = MineLocDecoder()
    decoder.feed(ranges_frame(5))
    decoder.reset()
    decoder.feed(ranges_frame(9))
    assert not decoder.losses


@pytest.mark.parametrize("bit", range(8 * len(ranges_frame())))
def test_no_frame_with_a_flipped_bit_is_accepted_and_the_next_is_found(bit):
    frame = bytearray(ranges_frame(1))
    frame[bit // 8] ^= 1 << bit % 8
    following = ranges_frame(2) * 60  # completes the longest payload a flipped length can announce
    messages, losses = decode(bytes(frame) + following)
    assert len(messages) == 60
    assert losses["crc"] + losses["length"] == (bit >= 16)
    assert losses["skipped_bytes"] == len(frame)


def test_a_frame_inside_the_payload_of_a_broken_one_is_found():
    broken = b"\x55\x57\x01\x03" + pack("<HH", 200, 0)
    messages, losses = decode(broken + ranges_frame() + bytes(200))
    assert len(messages) == 1
    assert losses["crc"] == 1


u8, u16, u32, u64 = (st.integers(0, 2**bits - 1) for bits in (8, 16, 32, 64))
ids = st.integers(1, 2**64 - 1)
thousandths = st.integers(-(2**31) + 1, 2**31 - 1).map(lambda value: value / 1000) | st.just(nan)
centi_db = st.integers(-(2**15) + 1, 2**15 - 1).map(lambda value: value / 100) | st.just(nan)
receptions = st.builds(
    Reception, u16, st.tuples(u16, u16, u16), u16, u16, u16, u16, u8, st.sampled_from([16, 64, 0, 77]), u8
)


@given(
    st.lists(st.tuples(ids, thousandths, thousandths, st.integers(-(2**31), 2**31 - 1), receptions), max_size=64),
    ids,
    u64,
    u32,
    u64,
    st.booleans(),
)
def test_encoded_ranges_decode_to_the_same(entries, tag_id, reporter_id, seq, ticks, corrected):
    measured = [
        Range(anchor, metres, *powers_dbm(reception), reception.first_path_index, ppm, offset)
        for anchor, metres, ppm, offset, reception in entries
    ]
    message = RangingRound(tag_id, reporter_id, seq, ticks or None, tuple(measured), corrected)
    messages, losses = decode(ranges_frame(0, message, [entry[-1] for entry in entries]))
    assert same(messages, [message])
    assert not losses


@given(
    st.lists(st.builds(TdoaDifference, ids, thousandths, centi_db, centi_db), max_size=64), ids, ids, u32, u64, centi_db
)
def test_an_encoded_blink_decodes_to_the_same(differences, tag_id, reference_id, seq, ticks, power):
    blink = TdoaBlink(tag_id, seq, ticks, reference_id, power, tuple(differences))
    messages, losses = decode(encode_frame(FrameType.TDOA, 0, encode_tdoa(blink)))
    assert same(messages, [blink])
    assert not losses


@given(st.binary(max_size=300), st.sampled_from(list(FrameType)))
def test_any_payload_under_a_good_crc_is_decoded_or_counted(payload, frame_type):
    messages, losses = decode(encode_frame(frame_type, 0, payload))
    assert len(messages) + losses["content"] == 1


def test_powers_are_nan_without_registers():
    [message], _ = decode(encode_frame(FrameType.CIR, 0, encode_cir(window(preamble_count=0))))
    assert isnan(message.first_path_power_dbm)
    assert isnan(message.receive_power_dbm)
