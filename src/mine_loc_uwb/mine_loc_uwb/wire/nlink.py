"""Nooploop LinkTrack Node_Frame3 (NLink V1.4): ranges of a tag with first-path and total power, little-endian.

    55 05 | length u16 | role u8 | id u8 | local time u32 [ms] | system time u32 [ms] | 4 reserved | supply u16 [mV]
    | n u8 | n * (role u8, id u8, distance i24 [mm], first path u8, total u8 [-0.5 dBm]) | sum of all bytes u8

Devices count from 0; our ids are those numbers plus 1. Frames of other functions (55 01, 55 04, ...) are passed over.
"""

from collections import Counter
from enum import IntEnum
from math import isnan, nan
from struct import Struct

from mine_loc_core.framing import INCOMPLETE, Damaged, Found, FrameScanner, Incomplete
from mine_loc_uwb.ranging import Message, Range, RangingRound

_START = b"\x55\x05"
_HEAD = Struct("<2xHBBII4xHB")
_NODE = Struct("<BB3sBB")
_MAX_NODES = 64


class Role(IntEnum):
    """What a device is; the numbers go over the wire."""

    ANCHOR = 1
    TAG = 2


def parse_frame(buffer: bytearray, offset: int) -> Found[Message] | Incomplete | Damaged:
    """Judge the Node_Frame3 that begins at `offset`."""
    start = offset + _HEAD.size
    if len(buffer) < start:
        return INCOMPLETE
    length, role, number, local_ms, _, _, count = _HEAD.unpack_from(buffer, offset)
    if count > _MAX_NODES or length != _HEAD.size + count * _NODE.size + 1:
        return Damaged("length")
    end = offset + length
    if len(buffer) < end:
        return INCOMPLETE
    if sum(buffer[offset : end - 1]) & 0xFF != buffer[end - 1]:
        return Damaged("checksum")
    if role != Role.TAG:
        return Damaged("role")
    ranges = tuple([_range(*node) for node in _NODE.iter_unpack(buffer[start : end - 1]) if node[0] == Role.ANCHOR])
    return Found(RangingRound(number + 1, number + 1, None, local_ms, ranges, corrected=False), length)


def _range(_role: int, number: int, distance: bytes, first_path: int, total: int) -> Range:
    return Range(number + 1, int.from_bytes(distance, "little", signed=True) / 1000, _dbm(first_path), _dbm(total))


def _dbm(value: int) -> float:
    return value / -2 if value else nan


class NlinkDecoder:
    """Decoder of Node_Frame3; the clock is the local time of the tag."""

    name = "nlink"
    tick_period_s = 1e-3
    counter_bits = 32
    seq_bits = 0

    def __init__(self) -> None:
        self._scanner = FrameScanner[Message](_START, parse_frame)
        self.losses: Counter[str] = self._scanner.losses

    def feed(self, data: bytes) -> list[Message]:
        """Take the next bytes of the stream and return the messages they complete, in order."""
        return self._scanner.feed(data)

    def reset(self) -> None:
        """Forget a partial frame, after the link was reopened."""
        self._scanner.reset()


def encode_round(ranging: RangingRound, *, system_ms: int = 0, supply_mv: int = 5000) -> bytes:
    """Encode a round as a tag sends it; failed ranges (NaN) are left out."""
    nodes = [
        _NODE.pack(
            Role.ANCHOR,
            each.anchor_id - 1,
            round(each.range_m * 1000).to_bytes(3, "little", signed=True),
            _half_db(each.first_path_power_dbm),
            _half_db(each.receive_power_dbm),
        )
        for each in ranging.ranges
        if not isnan(each.range_m)
    ]
    length = _HEAD.size + len(nodes) * _NODE.size + 1
    head = (length, Role.TAG, ranging.tag_id - 1, ranging.device_ticks or 0, system_ms, supply_mv, len(nodes))
    body = _START + _HEAD.pack(*head)[2:] + b"".join(nodes)
    return body + bytes((sum(body) & 0xFF,))


def _half_db(power_dbm: float) -> int:
    return 0 if isnan(power_dbm) else round(power_dbm * -2)
