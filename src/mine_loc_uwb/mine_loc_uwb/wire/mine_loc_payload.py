"""Payloads of the mine_loc frame: ranges of a round, differences of a blink, a window of the accumulator.

Layouts are specified in docs/wire-formats.md and written in C in firmware/mine_loc_frame.c. "Not reported" is the most
negative number of a signed field and 0 of an unsigned one.
"""

from collections.abc import Sequence
from enum import IntEnum
from math import isnan, nan
from struct import Struct

import numpy as np

from mine_loc_core.framing import Damaged
from mine_loc_uwb.ranging import DW1000_MAX_TAPS, CirWindow, Message, Range, RangingRound, TdoaBlink, TdoaDifference
from mine_loc_uwb.received_power import Reception, powers_dbm


class FrameType(IntEnum):
    """What a frame carries."""

    RANGES = 1
    TDOA = 2
    CIR = 3


MAX_ENTRIES = 64
"""Most ranges or differences in one frame."""

_ROUND = Struct("<QQQIBB")  # tag, reporter, time us, round, flags, count
_RANGE = Struct("<QiiiHHHHHHHHBBBx")  # anchor, mm, offset us, clock offset ppb, reception
_BLINK = Struct("<QQQIhBx")  # tag, reference anchor, time us, blink, power, count
_DIFFERENCE = Struct("<Qihh")  # anchor, mm, total power, first path power
_CIR = Struct("<QQQIiHHHHHHHHBBBxHH")  # tag, anchor, time us, round, mm, reception, start index, count
_TAP = np.dtype("<i2")

_FLAG_CORRECTED = 1
_NONE_16, _NONE_32 = -(1 << 15), -(1 << 31)

MAX_LENGTH = {
    FrameType.RANGES: _ROUND.size + MAX_ENTRIES * _RANGE.size,
    FrameType.TDOA: _BLINK.size + MAX_ENTRIES * _DIFFERENCE.size,
    FrameType.CIR: _CIR.size + DW1000_MAX_TAPS * 2 * _TAP.itemsize,
}
"""Longest payload by type [bytes]."""

_CONTENT = Damaged("content")


def decode_payload(frame_type: int, payload: bytes) -> Message | Damaged:
    """Decode the payload of a frame whose CRC is good; Damaged when its counts or ids make no sense."""
    if frame_type == FrameType.RANGES:
        return _decode_ranges(payload)
    if frame_type == FrameType.TDOA:
        return _decode_tdoa(payload)
    return _decode_cir(payload)


def _decode_ranges(payload: bytes) -> RangingRound | Damaged:
    if len(payload) < _ROUND.size:
        return _CONTENT
    tag_id, reporter_id, time_us, seq, flags, count = _ROUND.unpack_from(payload)
    if not tag_id or count > MAX_ENTRIES or len(payload) != _ROUND.size + count * _RANGE.size:
        return _CONTENT
    ranges = []
    for anchor_id, range_mm, offset_us, clock_ppb, *registers in _RANGE.iter_unpack(payload[_ROUND.size :]):
        if not anchor_id:
            return _CONTENT
        reception = _reception(registers)
        first_path_dbm, receive_dbm = powers_dbm(reception)
        ranges.append(
            Range(
                anchor_id,
                _thousandths(range_mm),
                first_path_dbm,
                receive_dbm,
                reception.first_path_index,
                _thousandths(clock_ppb),
                offset_us,
            )
        )
    corrected = bool(flags & _FLAG_CORRECTED)
    return RangingRound(tag_id, reporter_id, seq, time_us or None, tuple(ranges), corrected)


def encode_ranges(ranging: RangingRound, receptions: Sequence[Reception] = ()) -> bytes:
    """Encode the payload of a RANGES frame.

    `receptions` are the registers behind `ranging.ranges`, in the same order, or empty when the device reports none:
    powers and first path indices travel as registers, those of the ranges themselves are not encoded. Raises
    ValueError for more than MAX_ENTRIES ranges and struct.error for a number beyond its field.
    """
    _check_count(len(ranging.ranges))
    flags = _FLAG_CORRECTED if ranging.corrected else 0
    head = (ranging.tag_id, ranging.reporter_id, ranging.device_ticks or 0, ranging.seq or 0, flags)
    entries = [
        _RANGE.pack(
            each.anchor_id,
            _in_thousandths(each.range_m),
            each.ticks_offset,
            _in_thousandths(each.clock_offset_ppm),
            *_registers(reception),
        )
        for each, reception in zip(ranging.ranges, receptions or [Reception()] * len(ranging.ranges), strict=True)
    ]
    return _ROUND.pack(*head, len(entries)) + b"".join(entries)


def _decode_tdoa(payload: bytes) -> TdoaBlink | Damaged:
    if len(payload) < _BLINK.size:
        return _CONTENT
    tag_id, reference_id, time_us, seq, power, count = _BLINK.unpack_from(payload)
    if not (tag_id and reference_id) or count > MAX_ENTRIES or len(payload) != _BLINK.size + count * _DIFFERENCE.size:
        return _CONTENT
    differences = []
    for anchor_id, difference_mm, receive, first_path in _DIFFERENCE.iter_unpack(payload[_BLINK.size :]):
        if not anchor_id:
            return _CONTENT
        differences.append(
            TdoaDifference(anchor_id, _thousandths(difference_mm), _hundredths(receive), _hundredths(first_path))
        )
    return TdoaBlink(tag_id, seq, time_us, reference_id, _hundredths(power), tuple(differences))


def encode_tdoa(blink: TdoaBlink) -> bytes:
    """Encode the payload of a TDOA frame. Raises as `encode_ranges`."""
    _check_count(len(blink.differences))
    head = (blink.tag_id, blink.reference_anchor_id, blink.device_ticks, blink.seq)
    entries = [
        _DIFFERENCE.pack(
            each.anchor_id,
            _in_thousandths(each.range_difference_m),
            _in_hundredths(each.receive_power_dbm),
            _in_hundredths(each.first_path_power_dbm),
        )
        for each in blink.differences
    ]
    return _BLINK.pack(*head, _in_hundredths(blink.reference_receive_power_dbm), len(entries)) + b"".join(entries)


def _decode_cir(payload: bytes) -> CirWindow | Damaged:
    if len(payload) < _CIR.size:
        return _CONTENT
    tag_id, anchor_id, time_us, seq, range_mm, *registers, start, count = _CIR.unpack_from(payload)
    if not (tag_id and anchor_id) or start + count > DW1000_MAX_TAPS or len(payload) != _CIR.size + 4 * count:
        return _CONTENT
    reception = _reception(registers)
    taps = np.frombuffer(payload, _TAP, offset=_CIR.size).reshape(count, 2)
    first_path_dbm, receive_dbm = powers_dbm(reception)
    return CirWindow(
        tag_id=tag_id,
        anchor_id=anchor_id,
        seq=seq,
        device_ticks=time_us,
        range_m=_thousandths(range_mm),
        first_path_index=reception.first_path_index,
        start_index=start,
        preamble_count=reception.preamble_count,
        noise_std=float(reception.noise_std) if reception.noise_std else nan,
        first_path_amplitude=reception.first_path_amplitude,
        receive_power_counts=reception.receive_power_counts,
        channel=reception.channel,
        prf_mhz=reception.prf_mhz,
        in_phase=taps[:, 0].astype(np.int16),
        quadrature=taps[:, 1].astype(np.int16),
        first_path_power_dbm=first_path_dbm,
        receive_power_dbm=receive_dbm,
    )


def encode_cir(window: CirWindow, *, preamble_count_unsaturated: int = 0, sfd: int = 0) -> bytes:
    """Encode the payload of a CIR frame; the powers follow from the registers. Raises as `encode_ranges`."""
    count = len(window.in_phase)
    if window.start_index + count > DW1000_MAX_TAPS:
        raise ValueError(f"taps {window.start_index}..{window.start_index + count}: there are {DW1000_MAX_TAPS}")
    reception = Reception(
        first_path_index_64=0 if isnan(window.first_path_index) else round(window.first_path_index * 64),
        first_path_amplitude=window.first_path_amplitude,
        noise_std=0 if isnan(window.noise_std) else round(window.noise_std),
        receive_power_counts=window.receive_power_counts,
        preamble_count=window.preamble_count,
        preamble_count_unsaturated=preamble_count_unsaturated,
        channel=window.channel,
        prf_mhz=window.prf_mhz,
        sfd=sfd,
    )
    head = (window.tag_id, window.anchor_id, window.device_ticks, window.seq, _in_thousandths(window.range_m))
    taps = np.column_stack((window.in_phase, window.quadrature)).astype(_TAP)
    return _CIR.pack(*head, *_registers(reception), window.start_index, count) + taps.tobytes()


def _registers(reception: Reception) -> tuple[int, ...]:
    return (
        reception.first_path_index_64,
        *reception.first_path_amplitude,
        reception.noise_std,
        reception.receive_power_counts,
        reception.preamble_count,
        reception.preamble_count_unsaturated,
        reception.channel,
        reception.prf_mhz,
        reception.sfd,
    )


def _reception(registers: Sequence[int]) -> Reception:
    first_path_index, f1, f2, f3, *rest = registers
    return Reception(first_path_index, (f1, f2, f3), *rest)


def _check_count(count: int) -> None:
    if count > MAX_ENTRIES:
        raise ValueError(f"{count} entries: a frame holds at most {MAX_ENTRIES}")


def _thousandths(value: int) -> float:
    return nan if value == _NONE_32 else value / 1000


def _in_thousandths(value: float) -> int:
    return _NONE_32 if isnan(value) else round(value * 1000)


def _hundredths(value: int) -> float:
    return nan if value == _NONE_16 else value / 100


def _in_hundredths(value: float) -> int:
    return _NONE_16 if isnan(value) else round(value * 100)
