"""The DWM1001's binary UART interface: replies to a location request, little-endian type-length-value.

    40 01 00                    request done (any other error code ends the reply)
    41 0D x y z q               position: three int32 [mm], quality u8
    49 len n  n * 20 bytes      on a tag: anchor u16, distance u32 [mm], quality u8, the anchor's position as above
    48 len n  n * 13 bytes      on an anchor: anchor u64, distance u32 [mm], quality u8

There is no checksum: lengths, qualities (0..100) and distances are bounded instead, and a reply in which another one
begins is refused. The tag is not named (`tag_id` 0).
"""

from collections import Counter
from collections.abc import Mapping
from math import isnan
from struct import Struct

from mine_loc_core.framing import INCOMPLETE, Damaged, Found, FrameScanner, Incomplete
from mine_loc_uwb.ranging import AnchorRange, AnchorRanging, DevicePosition, Message, Range, RangingRound
from mine_loc_uwb.wire.dwm1001_shell import Point

LOCATION_REQUEST = b"\x0c\x00"

_START = b"\x40\x01"
_POSITION_TYPE, _ANCHOR_LIST_TYPE, _TAG_LIST_TYPE = 0x41, 0x48, 0x49
_POSITION = Struct("<iiiB")
_TAG_ENTRY = Struct("<HIBiiiB")
_ANCHOR_ENTRY = Struct("<QIB")
_LIST_ENTRY = {_TAG_LIST_TYPE: _TAG_ENTRY, _ANCHOR_LIST_TYPE: _ANCHOR_ENTRY}
_REPLY_HEAD = _START + bytes((0, _POSITION_TYPE, _POSITION.size))
_POSITION_END = 3 + 2 + _POSITION.size
_LAST_ERROR_CODE = 5
_MAX_DISTANCE_MM = 1_000_000
"""No DW1000 link is longer than 1 km; a distance beyond shows a false start."""

_Reply = Found[Message] | Incomplete | Damaged


def parse_reply(buffer: bytearray, offset: int) -> _Reply:
    """Judge the reply to a location request that begins at `offset`."""
    head = buffer[offset : offset + _POSITION_END + 1]
    if fault := _judge_head(head):
        return fault
    x_mm, y_mm, z_mm, quality = _POSITION.unpack_from(head, 5)
    if quality > 100:
        return Damaged("quality")
    position = DevicePosition(0, x_mm / 1000, y_mm / 1000, z_mm / 1000, quality)
    list_type = head[_POSITION_END]
    if list_type in _LIST_ENTRY:
        return _parse_list(buffer, offset, list_type, position)
    if list_type == _START[0]:  # the next reply: this one has no list
        return Found(position, _POSITION_END)
    return Damaged("type")


def _judge_head(head: bytearray) -> Incomplete | Damaged | None:
    """Judge a reply up to the type of its list; None = good."""
    if len(head) < 3:
        return INCOMPLETE
    if head[2]:
        return Damaged("device_error" if head[2] <= _LAST_ERROR_CODE else "error_code")
    if head[:5] != _REPLY_HEAD[: len(head)]:
        return Damaged("type")
    return INCOMPLETE if len(head) <= _POSITION_END else None


def _parse_list(buffer: bytearray, offset: int, list_type: int, position: DevicePosition) -> _Reply:
    entry = _LIST_ENTRY[list_type]
    start = offset + _POSITION_END + 3
    if len(buffer) < start:
        return INCOMPLETE
    length, count = buffer[start - 2], buffer[start - 1]
    if length != 1 + count * entry.size:
        return Damaged("length")
    end = start + count * entry.size
    if len(buffer) < end:
        return INCOMPLETE
    if _REPLY_HEAD in buffer[offset + 1 : end]:
        return Damaged("interrupted")
    entries = [(anchor, mm, quality) for anchor, mm, quality, *_ in entry.iter_unpack(buffer[start:end])]
    if any(mm > _MAX_DISTANCE_MM or quality > 100 for _, mm, quality in entries):
        return Damaged("entry")
    message: Message
    if list_type == _TAG_LIST_TYPE:
        ranges = tuple([Range(anchor, mm / 1000) for anchor, mm, _ in entries])
        message = RangingRound(0, 0, None, None, ranges, corrected=True, device_position=position)
    else:
        message = AnchorRanging(0, None, None, tuple([AnchorRange(0, anchor, mm / 1000) for anchor, mm, _ in entries]))
    return Found(message, end - offset)


class TlvDecoder:
    """Decoder of location replies; they carry neither a clock nor a counter."""

    name = "dwm1001_tlv"
    tick_period_s = 0.0
    counter_bits = 0
    seq_bits = 0

    def __init__(self) -> None:
        self._scanner = FrameScanner[Message](_START, parse_reply)
        self.losses: Counter[str] = self._scanner.losses

    def feed(self, data: bytes) -> list[Message]:
        """Take the next bytes of the stream and return the messages they complete, in order."""
        return self._scanner.feed(data)

    def reset(self) -> None:
        """Forget a partial reply, after the link was reopened."""
        self._scanner.reset()


def encode_tag_reply(ranging: RangingRound, anchor_positions_m: Mapping[int, Point]) -> bytes:
    """Encode a round as a tag replies; failed ranges (NaN) are left out, qualities of anchors are 100.

    Raises ValueError when the round has no device position, without which a reply has no beginning.
    """
    if ranging.device_position is None:
        raise ValueError("a location reply needs the device position")
    entries = [
        _TAG_ENTRY.pack(
            each.anchor_id, round(each.range_m * 1000), 100, *_millimetres(anchor_positions_m[each.anchor_id]), 100
        )
        for each in ranging.ranges
        if not isnan(each.range_m)
    ]
    return _encode_position(ranging.device_position) + _encode_list(_TAG_LIST_TYPE, entries)


def encode_anchor_reply(ranging: AnchorRanging, position: DevicePosition) -> bytes:
    """Encode distances to other anchors as an anchor at `position` replies."""
    entries = [_ANCHOR_ENTRY.pack(each.second_anchor_id, round(each.range_m * 1000), 100) for each in ranging.ranges]
    return _encode_position(position) + _encode_list(_ANCHOR_LIST_TYPE, entries)


def _encode_position(position: DevicePosition) -> bytes:
    xyz_mm = _millimetres((position.x_m, position.y_m, position.z_m))
    value = _POSITION.pack(*xyz_mm, position.quality_percent)
    return _REPLY_HEAD + value


def _encode_list(list_type: int, entries: list[bytes]) -> bytes:
    value = bytes((len(entries),)) + b"".join(entries)
    return bytes((list_type, len(value))) + value


def _millimetres(point_m: Point) -> tuple[int, int, int]:
    x, y, z = point_m
    return round(x * 1000), round(y * 1000), round(z * 1000)
