"""Text of Arduino and ESP32 firmware: thotro/arduino-dw1000, Makerfabs, and two single-line formats seen in the wild.

    from: 1782 <tab> Range: 1.23 m [<tab> RX power: -78.45 dBm]     arduino-dw1000; address in hex
    {"links":[{"A":"1782","R":"1.2"}]}                              Makerfabs; the range is a string in m
    T:ts:RR:tag:anchor:mm:mm:seq:object                             second mm repeats the first; numbers from 0
    Distance : 1.23                                                 Nordic two-way example; names no anchor (id 0)

Ids are the hexadecimal addresses as they are, in the third format the numbers plus 1. Only the second format holds a
whole round; of the others each line becomes a round of one range.
"""

import json
import re
from math import isnan, nan

from mine_loc_core.framing import Damaged
from mine_loc_core.line_splitter import LINE_END
from mine_loc_uwb.ranging import Message, Range, RangingRound
from mine_loc_uwb.wire.decoder import TextDecoder

_BOUNDARY = LINE_END + rb"|(?=from: )|(?=\{\"links\")|(?<=\]\})"
_NUMBER = r"-?\d{1,6}\.\d+"
_FROM = re.compile(
    rf"from:\s*([0-9A-Fa-f]{{1,4}})\s+Range:\s*({_NUMBER})\s*m(?:\s+RX power:\s*(?:({_NUMBER})|\w+)\s*dBm)?"
)
_REPORT = re.compile(r"T:\d+:RR:(\d{1,9}):(\d{1,9}):(-?\d{1,9}):(-?\d{1,9}):(\d{1,9}):\d+")
_DISTANCE = re.compile(rf"Distance\s*:\s*({_NUMBER})(?:\s*m)?", re.IGNORECASE)
_ADDRESS = re.compile(r"[0-9A-Fa-f]{1,16}")
_LINK_RANGE = re.compile(r"-?\d{1,6}(?:\.\d+)?")
_EVENT = re.compile(r"blink;.*|ranging init;.*|delete inactive device:.*")


def decoder() -> TextDecoder:
    """Decoder of all four formats; none carries a clock of known unit."""
    return TextDecoder("arduino", decode_line, boundary=_BOUNDARY)


def decode_line(line: str) -> Message | Damaged | None:
    """Decode one line; events (blink, ranging init, delete inactive device) are of no interest."""
    if match := _FROM.fullmatch(line):
        address, range_m, power = match.groups()
        return _round(Range(int(address, 16), float(range_m), receive_power_dbm=float(power) if power else nan))
    if line.startswith("{"):
        return _decode_links(line)
    if match := _REPORT.fullmatch(line):
        tag, anchor, range_mm, check_mm, seq = map(int, match.groups())
        if range_mm != check_mm:
            return Damaged("check")
        return _round(Range(anchor + 1, range_mm / 1000), tag_id=tag + 1, seq=seq)
    if match := _DISTANCE.fullmatch(line):
        return _round(Range(0, float(match[1])))
    return None if _EVENT.fullmatch(line) else Damaged("unrecognised_line")


def _decode_links(line: str) -> Message | Damaged:
    try:
        links = json.loads(line)["links"]
        pairs = [(link["A"], link["R"]) for link in links]
        if all(_ADDRESS.fullmatch(address) and _LINK_RANGE.fullmatch(range_m) for address, range_m in pairs):
            return _round(*(Range(int(address, 16), float(range_m)) for address, range_m in pairs))
    except (ValueError, TypeError, KeyError, RecursionError):
        return Damaged("json")
    return Damaged("field_value")


def _round(*ranges: Range, tag_id: int = 0, seq: int | None = None) -> RangingRound:
    return RangingRound(tag_id, 0, seq, None, ranges, corrected=False)


def encode_from(measured: Range) -> bytes:
    """Encode one range as arduino-dw1000 prints it, without a power that is NaN."""
    power = "" if isnan(measured.receive_power_dbm) else f"\t RX power: {measured.receive_power_dbm:.2f} dBm"
    return f"from: {measured.anchor_id:X}\t Range: {measured.range_m:.2f} m{power}\r\n".encode()


def encode_links(ranging: RangingRound) -> bytes:
    """Encode a round as Makerfabs firmware sends it, to a decimetre; failed ranges (NaN) are left out."""
    links = [
        {"A": f"{each.anchor_id:X}", "R": f"{each.range_m:.1f}"} for each in ranging.ranges if not isnan(each.range_m)
    ]
    return json.dumps({"links": links}, separators=(",", ":")).encode()


def encode_report(ranging: RangingRound, time: int) -> bytes:
    """Encode a round as `T:` lines, one a range; `time` is the device's own count, of unknown unit."""
    lines = []
    for each in ranging.ranges:
        range_mm = round(each.range_m * 1000)
        ids = f"{ranging.tag_id - 1}:{each.anchor_id - 1}"
        lines.append(f"T:{time}:RR:{ids}:{range_mm}:{range_mm}:{ranging.seq or 0}:0\r\n")
    return "".join(lines).encode()


def encode_distance(range_m: float) -> bytes:
    """Encode one distance as the Nordic two-way example prints it."""
    return f"Distance : {range_m:f}\r\n".encode()
