"""TREK1000 / EVK1000 report lines (TREK1000 User Manual, section 8.1.1) and those of its clones.

    mr|mc MASK R0 R1 R2 R3 NRANGES RSEQ EXTRA  aT:A      all numbers but T and A hexadecimal, ranges in mm, signed
    ma    MASK 0  A0A1 A0A2 A1A2 NRANGES RSEQ EXTRA a0:0

`mr` is raw and EXTRA its antenna delays, `mc` is corrected for range bias and EXTRA a millisecond counter. The kit
counts tags and anchors from 0; our ids are those numbers plus 1 (A0 -> 1, T0 -> 1), because id 0 is invalid.
"""

import re
from collections.abc import Sequence
from math import isnan

from mine_loc_core.framing import Damaged
from mine_loc_core.line_splitter import LINE_END
from mine_loc_uwb.ranging import AnchorRange, AnchorRanging, Message, Range, RangingRound
from mine_loc_uwb.wire.decoder import TextDecoder

_BOUNDARY = LINE_END + rb"|(?=[mM][rRcCaAeE] )"
_LINE = re.compile(r"m([rca])((?: +[0-9a-f]{1,8})+) +([at])(\d{1,4}):(\d{1,4})(?: +[0-9a-f]+)?", re.IGNORECASE)
_ANCHOR_PAIRS = ((1, 2), (1, 3), (2, 3))
_PLAIN, _CLONE_8 = 4, 8
_RANGES_OF_FIELDS = {1 + n + 3 + extra: n for n in (_PLAIN, _CLONE_8) for extra in (0, 1)}
"""Ranges in a line of so many hex fields: MASK, the ranges, NRANGES, RSEQ, EXTRA and the extra field of some clones."""


def decoder() -> TextDecoder:
    """Decoder of `mr`, `mc` and `ma` lines; the clock is the millisecond counter of `mc`."""
    return TextDecoder("trek1000", decode_line, boundary=_BOUNDARY, tick_period_s=1e-3, counter_bits=32, seq_bits=8)


def decode_line(line: str) -> Message | Damaged | None:
    """Decode one report line; `me` event counters are of no interest."""
    match = _LINE.fullmatch(line)
    if match is None:
        return None if line[:3].lower() == "me " else Damaged("unrecognised_line")
    kind, fields, reporter, tag, anchor = match[1].lower(), match[2].split(), match[3].lower(), match[4], match[5]
    count = _RANGES_OF_FIELDS.get(len(fields))
    if count is None or (kind == "a" and count != _PLAIN):
        return Damaged("field_count")
    ranges = fields[1 : 1 + count] if kind != "a" else fields[2 : 1 + count]
    mask, seq, extra = int(fields[0], 16), int(fields[count + 2], 16) & 0xFF, int(fields[count + 3], 16)
    if mask >> len(ranges):
        return Damaged("mask")
    if not _padded_alike(ranges):
        return Damaged("field_width")
    reporter_id = 1 + int(anchor if reporter == "a" else tag)
    valid = [(i, _signed(int(value, 16)) / 1000) for i, value in enumerate(ranges) if mask >> i & 1]
    if kind == "a":
        return AnchorRanging(reporter_id, seq, extra, tuple([AnchorRange(*_ANCHOR_PAIRS[i], m) for i, m in valid]))
    ticks = extra if kind == "c" else None
    return RangingRound(1 + int(tag), reporter_id, seq, ticks, tuple([Range(i + 1, m) for i, m in valid]), kind == "c")


def encode_round(
    ranging: RangingRound,
    *,
    range_count: int = 0,
    antenna_delays: int = 0x4042_4042,
    anchor_reports: bool = True,
    slots: int = _PLAIN,
) -> bytes:
    """Encode a round as one line, `mc` when corrected and `mr` otherwise.

    `range_count` is NRANGES, `antenna_delays` the EXTRA of `mr`, `slots` the 4 ranges of the kit or 8 of clones.
    Raises ValueError for an id without a slot.
    """
    values_mm: list[int | None] = [None] * slots
    for measured in ranging.ranges:
        if not 1 <= measured.anchor_id <= slots:
            raise ValueError(f"anchor id {measured.anchor_id}: the line has room for ids 1..{slots}")
        values_mm[measured.anchor_id - 1] = None if isnan(measured.range_m) else round(measured.range_m * 1000)
    extra = (ranging.device_ticks or 0) if ranging.corrected else antenna_delays
    anchor = ranging.reporter_id - 1 if anchor_reports else 0
    suffix = f"{'a' if anchor_reports else 't'}{ranging.tag_id - 1}:{anchor}"
    kind = "mc" if ranging.corrected else "mr"
    return _line(kind, values_mm, range_count=range_count, seq=ranging.seq, extra=extra, suffix=suffix)


def encode_anchor_ranging(ranging: AnchorRanging, *, range_count: int = 0) -> bytes:
    """Encode distances among anchors 1..3 as an `ma` line. Raises ValueError for any other pair."""
    values_mm: list[int | None] = [None] * len(_ANCHOR_PAIRS)
    for measured in ranging.ranges:
        pair = (measured.first_anchor_id, measured.second_anchor_id)
        values_mm[_ANCHOR_PAIRS.index(pair)] = round(measured.range_m * 1000)
    extra, suffix = ranging.device_ticks or 0, f"a0:{ranging.reporter_id - 1}"
    return _line("ma", values_mm, range_count=range_count, seq=ranging.seq, extra=extra, suffix=suffix)


def _line(
    kind: str, values_mm: Sequence[int | None], *, range_count: int, seq: int | None, extra: int, suffix: str
) -> bytes:
    mask = sum(1 << i for i, value in enumerate(values_mm) if value is not None)
    leading_zero = ["00000000"] if kind == "ma" else []
    ranges = " ".join(leading_zero + [f"{(value or 0) & 0xFFFF_FFFF:08x}" for value in values_mm])
    numbers = f"{range_count & 0xFFFF:04x} {(seq or 0) & 0xFF:02x} {extra & 0xFFFF_FFFF:08x}"
    return f"{kind} {mask:02x} {ranges} {numbers} {suffix}\r\n".encode()


def _signed(value: int) -> int:
    return value - (1 << 32) if value >> 31 else value


def _padded_alike(fields: Sequence[str]) -> bool:
    """Whether one printf width explains all fields; the line has no checksum, and this finds a lost character."""
    width = min(map(len, fields))
    return all(len(field) == width or field[0] != "0" for field in fields)
