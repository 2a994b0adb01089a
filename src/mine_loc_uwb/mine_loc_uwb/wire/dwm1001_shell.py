"""Text of the DWM1001 (PANS) shell: the streams `lec`, `les` and `lep`, and the position lines of a listener.

    DIST,n,AN0,id,x,y,z,distance,...[,POS,x,y,z,quality]      lec
    id[x,y,z]=distance ... le_us=n [est[x,y,z,quality]]       les
    POS,x,y,z,quality                                         lep
    POS,n,tag,x,y,z,quality,hex                               listener

Lengths in m with two decimals, ids four hex digits. No line names the tag that speaks, so `tag_id` is 0. The lines
carry no checksum and are sometimes garbled at 10 Hz: a line that deviates anywhere is dropped whole.
"""

import re
from collections.abc import Mapping
from math import isnan

from mine_loc_core.framing import Damaged
from mine_loc_core.line_splitter import LINE_END
from mine_loc_uwb.ranging import DevicePosition, Message, Range, RangingRound
from mine_loc_uwb.wire.decoder import TextDecoder

PROMPT = b"dwm> "
Point = tuple[float, float, float]

_BOUNDARY = LINE_END + rb"|(?<=dwm> )|(?=DIST,)"
_NUMBER = r"(-?\d{1,7}\.\d\d)"
_POINT = rf"{_NUMBER},{_NUMBER},{_NUMBER}"
_QUALITY = r"(100|\d{1,2})"
_LEC_ANCHOR = re.compile(rf"AN(\d+),([0-9A-Fa-f]{{4}}),{_POINT},{_NUMBER}")
_LEC_ANCHOR_FIELDS, _LEC_POSITION_FIELDS = 6, 5
_LES_ANCHOR = re.compile(rf"([0-9A-Fa-f]{{4}})\[{_POINT}\]={_NUMBER}")
_LES_TAIL = re.compile(rf"le_us=\d+(?: est\[{_POINT},{_QUALITY}\])?")
_POSITION = re.compile(rf"POS,{_POINT},{_QUALITY}")
_LISTENED_POSITION = re.compile(rf"POS,\d+,([0-9A-Fa-f]{{4}}),{_POINT},{_QUALITY},[0-9A-Fa-fx]+")
_CHATTER = re.compile(r"(?:dwm> ?)?(?:lec|les|lep)?|DWM1001.*|Copyright.*|License.*|Compiled.*|Help *:.*")


def decoder() -> TextDecoder:
    """Decoder of the shell's streams; they carry neither a clock nor a counter."""
    return TextDecoder("dwm1001_shell", decode_line, boundary=_BOUNDARY)


def decode_line(line: str) -> Message | Damaged | None:
    """Decode one line of any of the streams; prompt, echo and banner are of no interest."""
    if line.startswith("DIST,"):
        return _decode_lec(line)
    if line.startswith("POS,"):
        return _decode_position(line)
    if "le_us=" in line:
        return _decode_les(line)
    return None if _CHATTER.fullmatch(line) else Damaged("unrecognised_line")


def _decode_lec(line: str) -> Message | Damaged:
    fields = line.split(",")
    if not (fields[1].isdecimal() and len(fields[1]) <= 2):
        return Damaged("field_count")
    count = int(fields[1])
    end = 2 + count * _LEC_ANCHOR_FIELDS
    if len(fields) not in (end, end + _LEC_POSITION_FIELDS):
        return Damaged("field_count")
    ranges = []
    for i in range(count):
        first = 2 + i * _LEC_ANCHOR_FIELDS
        match = _LEC_ANCHOR.fullmatch(",".join(fields[first : first + _LEC_ANCHOR_FIELDS]))
        if match is None or int(match[1]) != i:
            return Damaged("field_value")
        ranges.append(Range(int(match[2], 16), float(match[6])))
    position = None
    if len(fields) > end:
        match = _POSITION.fullmatch(",".join(fields[end:]))
        if match is None:
            return Damaged("field_value")
        position = _position(0, *match.groups())
    return _round(ranges, position)


def _decode_les(line: str) -> Message | Damaged:
    anchors, tail = line[: line.index("le_us=")].split(), line[line.index("le_us=") :]
    matches = [_LES_ANCHOR.fullmatch(anchor) for anchor in anchors]
    end = _LES_TAIL.fullmatch(tail)
    ranges = [Range(int(match[1], 16), float(match[5])) for match in matches if match]
    if end is None or len(ranges) < len(anchors):
        return Damaged("field_value")
    return _round(ranges, _position(0, *end.groups()) if end[1] else None)


def _decode_position(line: str) -> DevicePosition | Damaged:
    if match := _POSITION.fullmatch(line):
        return _position(0, *match.groups())
    if match := _LISTENED_POSITION.fullmatch(line):
        return _position(int(match[1], 16), *match.groups()[1:])
    return Damaged("field_value")


def _position(tag_id: int, x: str, y: str, z: str, quality: str) -> DevicePosition:
    return DevicePosition(tag_id, float(x), float(y), float(z), int(quality))


def _round(ranges: list[Range], position: DevicePosition | None) -> RangingRound:
    return RangingRound(0, 0, None, None, tuple(ranges), corrected=True, device_position=position)


def encode_lec(ranging: RangingRound, anchor_positions_m: Mapping[int, Point]) -> bytes:
    """Encode a round as the `lec` stream prints it; failed ranges (NaN) are left out."""
    measured = [each for each in ranging.ranges if not isnan(each.range_m)]
    fields = [f"DIST,{len(measured)}"]
    for i, each in enumerate(measured):
        x, y, z = anchor_positions_m[each.anchor_id]
        fields.append(f"AN{i},{each.anchor_id:04X},{x:.2f},{y:.2f},{z:.2f},{each.range_m:.2f}")
    if ranging.device_position:
        fields.append(_position_text(ranging.device_position))
    return (",".join(fields) + "\r\n").encode()


def encode_les(ranging: RangingRound, anchor_positions_m: Mapping[int, Point], solve_us: int) -> bytes:
    """Encode a round as the `les` stream prints it, `solve_us` being the time its location engine took."""
    fields = []
    for each in ranging.ranges:
        if not isnan(each.range_m):
            x, y, z = anchor_positions_m[each.anchor_id]
            fields.append(f"{each.anchor_id:04X}[{x:.2f},{y:.2f},{z:.2f}]={each.range_m:.2f}")
    fields.append(f"le_us={solve_us}")
    if ranging.device_position:
        fields.append(f"est[{_position_text(ranging.device_position).removeprefix('POS,')}]")
    return (" ".join(fields) + "\r\n").encode()


def encode_lep(position: DevicePosition) -> bytes:
    """Encode a position as the `lep` stream prints it."""
    return (_position_text(position) + "\r\n").encode()


def _position_text(position: DevicePosition) -> str:
    return f"POS,{position.x_m:.2f},{position.y_m:.2f},{position.z_m:.2f},{position.quality_percent}"
