"""The C encoder in firmware/, compiled here, against the Python encoder and the decoder."""

import ctypes as c
import shutil
import subprocess
from math import nan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_uwb.ranging import CirWindow, Range, RangingRound, TdoaBlink, TdoaDifference
from mine_loc_uwb.received_power import Reception
from mine_loc_uwb.wire.mine_loc_frame import MineLocDecoder, encode_frame
from mine_loc_uwb.wire.mine_loc_payload import FrameType, encode_cir, encode_ranges, encode_tdoa

FIRMWARE = Path(__file__).parents[3] / "firmware"
NONE_32, NONE_16 = -(2**31), -(2**15)


class CReception(c.Structure):
    _fields_ = (
        ("first_path_index", c.c_uint16),
        ("first_path_amplitude", c.c_uint16 * 3),
        ("noise_std", c.c_uint16),
        ("receive_power", c.c_uint16),
        ("preamble_count", c.c_uint16),
        ("preamble_count_unsaturated", c.c_uint16),
        ("channel", c.c_uint8),
        ("prf_mhz", c.c_uint8),
        ("sfd", c.c_uint8),
    )


class CRound(c.Structure):
    _fields_ = (
        ("tag_id", c.c_uint64),
        ("reporter_id", c.c_uint64),
        ("time_us", c.c_uint64),
        ("seq", c.c_uint32),
        ("corrected", c.c_uint8),
    )


class CRange(c.Structure):
    _fields_ = (
        ("anchor_id", c.c_uint64),
        ("range_mm", c.c_int32),
        ("offset_us", c.c_int32),
        ("clock_offset_ppb", c.c_int32),
        ("reception", CReception),
    )


class CBlink(c.Structure):
    _fields_ = (
        ("tag_id", c.c_uint64),
        ("reference_anchor_id", c.c_uint64),
        ("time_us", c.c_uint64),
        ("seq", c.c_uint32),
        ("receive_power_cdbm", c.c_int16),
    )


class CDifference(c.Structure):
    _fields_ = (
        ("anchor_id", c.c_uint64),
        ("range_difference_mm", c.c_int32),
        ("receive_power_cdbm", c.c_int16),
        ("first_path_power_cdbm", c.c_int16),
    )


class CCir(c.Structure):
    _fields_ = (
        ("tag_id", c.c_uint64),
        ("anchor_id", c.c_uint64),
        ("time_us", c.c_uint64),
        ("seq", c.c_uint32),
        ("range_mm", c.c_int32),
        ("reception", CReception),
        ("start_index", c.c_uint16),
    )


@pytest.fixture(scope="module")
def encoder(tmp_path_factory):
    compiler = shutil.which("cc") or shutil.which("gcc")
    assert compiler, "a C compiler is needed (Debian and Ubuntu: g++)"
    library = tmp_path_factory.mktemp("firmware") / "mine_loc_frame.so"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Wconversion", "-O2", "-shared", "-fPIC"]
    subprocess.run([compiler, *flags, str(FIRMWARE / "mine_loc_frame.c"), "-o", str(library)], check=True)
    loaded = c.CDLL(str(library))
    for name in ("ranges", "tdoa", "cir"):
        function = getattr(loaded, f"mine_loc_encode_{name}")
        function.restype = c.c_size_t
        function.argtypes = [c.c_char_p, c.c_size_t, c.c_uint16, c.c_void_p, c.c_void_p, c.c_size_t]
    return loaded


def call(function, capacity, number, head, entries, count):
    out = c.create_string_buffer(5000)
    written = function(out, capacity, number, c.byref(head), entries, count)
    assert out.raw[written:] == bytes(5000 - written)
    return out.raw[:written]


def c_reception(reception):
    return CReception(
        reception.first_path_index_64,
        (c.c_uint16 * 3)(*reception.first_path_amplitude),
        reception.noise_std,
        reception.receive_power_counts,
        reception.preamble_count,
        reception.preamble_count_unsaturated,
        reception.channel,
        reception.prf_mhz,
        reception.sfd,
    )


def milli(value, none=NONE_32):
    return nan if value == none else value / 1000


def centi(value):
    return nan if value == NONE_16 else value / 100


u8, u16, u32, u64 = (st.integers(0, 2**bits - 1) for bits in (8, 16, 32, 64))
i16, i32 = (st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (16, 32))
ids = st.integers(1, 2**64 - 1)
receptions = st.builds(Reception, u16, st.tuples(u16, u16, u16), u16, u16, u16, u16, u8, u8, u8)


@given(st.lists(st.tuples(ids, i32, i32, i32, receptions), max_size=64), ids, u64, u64, u32, st.booleans(), u16)
def test_ranges_are_the_same_bytes(encoder, entries, tag_id, reporter_id, ticks, seq, corrected, number):
    c_ranges = (CRange * len(entries))(*(CRange(*fields, c_reception(reception)) for *fields, reception in entries))
    head = CRound(tag_id, reporter_id, ticks, seq, corrected)
    frame = call(encoder.mine_loc_encode_ranges, 5000, number, head, c_ranges, len(entries))
    measured = tuple(
        Range(anchor, milli(mm), clock_offset_ppm=milli(ppb), ticks_offset=offset)
        for anchor, mm, offset, ppb, _ in entries
    )
    message = RangingRound(tag_id, reporter_id, seq, ticks, measured, corrected)
    assert frame == encode_frame(FrameType.RANGES, number, encode_ranges(message, [entry[-1] for entry in entries]))
    [decoded] = MineLocDecoder().feed(frame)
    assert [each.anchor_id for each in decoded.ranges] == [entry[0] for entry in entries]


@given(st.lists(st.tuples(ids, i32, i16, i16), max_size=64), ids, ids, u64, u32, i16, u16)
def test_differences_are_the_same_bytes(encoder, entries, tag_id, reference_id, ticks, seq, power, number):
    c_differences = (CDifference * len(entries))(*(CDifference(*entry) for entry in entries))
    head = CBlink(tag_id, reference_id, ticks, seq, power)
    frame = call(encoder.mine_loc_encode_tdoa, 5000, number, head, c_differences, len(entries))
    differences = tuple(TdoaDifference(anchor, milli(mm), centi(rx), centi(fp)) for anchor, mm, rx, fp in entries)
    blink = TdoaBlink(tag_id, seq, ticks, reference_id, centi(power), differences)
    assert frame == encode_frame(FrameType.TDOA, number, encode_tdoa(blink))
    assert repr(MineLocDecoder().feed(frame)) == repr([blink])


@given(
    st.integers(0, 1016).flatmap(lambda count: st.tuples(st.just(count), st.integers(0, 1016 - count))),
    st.integers(0, 2**32 - 1),
    ids,
    ids,
    u64,
    u32,
    i32,
    receptions,
    u16,
)
def test_accumulators_are_the_same_bytes(
    encoder, span, seed, tag_id, anchor_id, ticks, seq, range_mm, reception, number
):
    count, start = span
    taps = np.random.default_rng(seed).integers(-(2**15), 2**15, (count, 2), dtype=np.int16)
    head = CCir(tag_id, anchor_id, ticks, seq, range_mm, c_reception(reception), start)
    frame = call(encoder.mine_loc_encode_cir, 5000, number, head, taps.ctypes.data_as(c.c_void_p), count)
    window = CirWindow(
        tag_id=tag_id,
        anchor_id=anchor_id,
        seq=seq,
        device_ticks=ticks,
        range_m=milli(range_mm),
        first_path_index=reception.first_path_index,
        start_index=start,
        preamble_count=reception.preamble_count,
        noise_std=float(reception.noise_std),
        first_path_amplitude=reception.first_path_amplitude,
        receive_power_counts=reception.receive_power_counts,
        channel=reception.channel,
        prf_mhz=reception.prf_mhz,
        in_phase=taps[:, 0],
        quadrature=taps[:, 1],
    )
    payload = encode_cir(window, preamble_count_unsaturated=reception.preamble_count_unsaturated, sfd=reception.sfd)
    assert frame == encode_frame(FrameType.CIR, number, payload)
    [decoded] = MineLocDecoder().feed(frame)
    np.testing.assert_array_equal(decoded.in_phase, taps[:, 0])
    np.testing.assert_array_equal(decoded.quadrature, taps[:, 1])


def test_a_frame_that_does_not_fit_is_not_written(encoder):
    head, ranges = CRound(tag_id=1), (CRange * 65)()
    assert len(call(encoder.mine_loc_encode_ranges, 120, 0, head, ranges, 2)) == 120
    assert call(encoder.mine_loc_encode_ranges, 119, 0, head, ranges, 2) == b""


def test_limits_are_kept(encoder):
    assert call(encoder.mine_loc_encode_ranges, 5000, 0, CRound(tag_id=1), (CRange * 65)(), 65) == b""
    assert call(encoder.mine_loc_encode_tdoa, 5000, 0, CBlink(tag_id=1), (CDifference * 65)(), 65) == b""
    assert call(encoder.mine_loc_encode_cir, 5000, 0, CCir(start_index=1), (c.c_int16 * 2032)(), 1016) == b""
    assert call(encoder.mine_loc_encode_cir, 5000, 0, CCir(), (c.c_int16 * 2034)(), 1017) == b""
    assert len(call(encoder.mine_loc_encode_cir, 5000, 0, CCir(), (c.c_int16 * 2032)(), 1016)) == 4130
