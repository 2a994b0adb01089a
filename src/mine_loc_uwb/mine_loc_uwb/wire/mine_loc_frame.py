"""The mine_loc frame: our own format, for firmware that reports diagnostics, time differences or the accumulator.

    55 57 | version u8 | type u8 | length u16 | frame number u16 | payload | CRC-16/XMODEM u16

Little-endian; the CRC covers everything after the two sync bytes. Specified in docs/wire-formats.md, written in C in
firmware/. The clock is a 64-bit count of microseconds.
"""

from binascii import crc_hqx
from collections import Counter
from struct import Struct
from typing import NamedTuple

from mine_loc_core.framing import INCOMPLETE, Damaged, Found, FrameScanner, Incomplete
from mine_loc_uwb.ranging import Message
from mine_loc_uwb.wire.mine_loc_payload import MAX_LENGTH, FrameType, decode_payload

SYNC = b"\x55\x57"
VERSION = 1
_HEADER = Struct("<2xBBHH")
_CRC = Struct("<H")
_MAX_PAYLOAD = max(MAX_LENGTH.values())
_RESTART_GAP = 1000
"""A jump of the frame number by this many is a restarted device rather than that many lost frames."""


class _Frame(NamedTuple):
    version: int
    type: int
    number: int
    payload: bytes


def encode_frame(frame_type: FrameType, frame_number: int, payload: bytes) -> bytes:
    """Put a payload of `mine_loc_payload` into a frame; `frame_number` counts the frames of one serial line."""
    body = _HEADER.pack(VERSION, frame_type, len(payload), frame_number & 0xFFFF)[2:] + payload
    return SYNC + body + _CRC.pack(crc_hqx(body, 0))


def parse_frame(buffer: bytearray, offset: int) -> Found[_Frame] | Incomplete | Damaged:
    """Judge the frame that begins at `offset`."""
    start = offset + _HEADER.size
    if len(buffer) < start:
        return INCOMPLETE
    version, frame_type, length, number = _HEADER.unpack_from(buffer, offset)
    if length > _MAX_PAYLOAD:
        return Damaged("length")
    end = start + length + _CRC.size
    if len(buffer) < end:
        return INCOMPLETE
    body = bytes(buffer[offset + len(SYNC) : end])
    if crc_hqx(body[: -_CRC.size], 0) != _CRC.unpack_from(body, len(body) - _CRC.size)[0]:
        return Damaged("crc")
    payload = body[_HEADER.size - len(SYNC) : -_CRC.size]
    return Found(_Frame(version, frame_type, number, payload), end - offset)


class MineLocDecoder:
    """Decoder of the mine_loc frame.

    Frames of an unknown version or type are counted and skipped; gaps in the frame number count as `missing_frames`.
    """

    name = "mine_loc"
    tick_period_s = 1e-6
    counter_bits = 64
    seq_bits = 32

    def __init__(self) -> None:
        self._scanner = FrameScanner[_Frame](SYNC, parse_frame)
        self._last_number: int | None = None
        self.losses: Counter[str] = self._scanner.losses

    def feed(self, data: bytes) -> list[Message]:
        """Take the next bytes of the stream and return the messages they complete, in order."""
        messages = []
        for frame in self._scanner.feed(data):
            self._count_missing(frame.number)
            result = self._decode(frame)
            if isinstance(result, Damaged):
                self.losses[result.kind] += 1
            else:
                messages.append(result)
        return messages

    def reset(self) -> None:
        """Forget a partial frame and the frame number, after the link was reopened."""
        self._scanner.reset()
        self._last_number = None

    def _decode(self, frame: _Frame) -> Message | Damaged:
        if frame.version != VERSION:
            return Damaged("unknown_version")
        if frame.type not in MAX_LENGTH:
            return Damaged("unknown_type")
        return decode_payload(frame.type, frame.payload)

    def _count_missing(self, number: int) -> None:
        if self._last_number is not None:
            missing = (number - self._last_number - 1) & 0xFFFF
            if missing >= _RESTART_GAP:
                self.losses["restart"] += 1
            elif missing:
                self.losses["missing_frames"] += missing
        self._last_number = number
