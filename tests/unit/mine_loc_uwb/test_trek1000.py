from math import nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_uwb.ranging import AnchorRange, AnchorRanging, Range, RangingRound
from mine_loc_uwb.wire import trek1000

MR = b"mr 0f 000005a4 000004c8 00000436 000003f9 0958 c0 40424042 a0:0"
MC = b"mc 0f 00000663 000005a3 00000512 000004cb 095f c1 00024c24 a0:0"
MA = b"ma 07 00000000 0000085c 00000659 000006b7 095b 26 00024bed a0:0"
MR_THREE = b"mr 07 00000407 0000082b 000007a3 00000000 6cba 09 40414041 a0:0"
MC_NEGATIVE = b"mc 01 ffffffec 00000000 00000000 00000000 0001 00 00000000 t0:0"


def decode(*chunks):
    decoder = trek1000.decoder()
    return [message for chunk in chunks for message in decoder.feed(chunk)], decoder.losses


def ranges(*values_m):
    return tuple(Range(i + 1, value) for i, value in enumerate(values_m))


VECTORS = [
    (MR, RangingRound(1, 1, 0xC0, None, ranges(1.444, 1.224, 1.078, 1.017), corrected=False)),
    (MC, RangingRound(1, 1, 0xC1, 0x24C24, ranges(1.635, 1.443, 1.298, 1.227), corrected=True)),
    (MR_THREE, RangingRound(1, 1, 9, None, ranges(1.031, 2.091, 1.955), corrected=False)),
    (MC_NEGATIVE, RangingRound(1, 1, 0, 0, ranges(-0.020), corrected=True)),
]
ANCHORS = AnchorRanging(
    1, 0x26, 0x24BED, (AnchorRange(1, 2, 2.140), AnchorRange(1, 3, 1.625), AnchorRange(2, 3, 1.719))
)


def same(a, b):
    """Equality that takes NaN for equal, which dataclasses with NaN defaults do not."""
    return repr(a) == repr(b)


@pytest.mark.parametrize(("line", "expected"), VECTORS)
def test_published_lines_decode(line, expected):
    messages, losses = decode(line + b"\r\n")
    assert same(messages, [expected])
    assert not losses


@pytest.mark.parametrize(
    ("line", "message", "fields"),
    [
        (VECTORS[0][0], VECTORS[0][1], {"range_count": 0x958, "antenna_delays": 0x40424042}),
        (VECTORS[1][0], VECTORS[1][1], {"range_count": 0x95F}),
        (VECTORS[2][0], VECTORS[2][1], {"range_count": 0x6CBA, "antenna_delays": 0x40414041}),
        (VECTORS[3][0], VECTORS[3][1], {"range_count": 1, "anchor_reports": False}),
    ],
)
def test_published_lines_encode(line, message, fields):
    assert trek1000.encode_round(message, **fields) == line + b"\r\n"


def test_anchor_ranging_decodes_and_encodes():
    messages, losses = decode(MA + b"\n")
    assert messages == [ANCHORS]
    assert not losses
    assert trek1000.encode_anchor_ranging(ANCHORS, range_count=0x95B) == MA + b"\r\n"


@pytest.mark.parametrize(
    "line",
    [
        MC + b"\n",
        MC + b"\r",
        MC + b" \r\n",
        MC + b"\0",
        MC + b" 0a\n",  # one extra field after the suffix
        MC.replace(b" a0:0", b" 00 a0:0") + b"\n",  # or before it
        MC.upper() + b"\n",
        MC.replace(b" 095f c1 ", b" 095f 00c1 ").replace(b"0f ", b"000f ", 1) + b"\n",
        MC.replace(b"0000", b"") + b"\n",  # ranges padded to four digits
        b"\0\0\xff\x00" + MC + b"\n",
        b"mc 0f 00000" + MC + b"\n",  # a line cut short, its end lost
    ],
)
def test_variants_of_clones_decode_alike(line):
    messages, _ = decode(line)
    assert same(messages, [VECTORS[1][1]])


def test_a_line_without_an_end_is_complete_when_the_next_begins():
    messages, losses = decode(MR + MC + MA + b"\n")
    assert same(messages, [VECTORS[0][1], VECTORS[1][1], ANCHORS])
    assert not losses


def test_eight_ranges_of_a_clone_decode():
    line = b"mc 81" + b" 000003e8" * 8 + b" 0001 02 00000003 a1:0\n"
    messages, _ = decode(line)
    assert same(messages, [RangingRound(2, 1, 2, 3, (Range(1, 1.0), Range(8, 1.0)), corrected=True)])
    assert same(decode(trek1000.encode_round(messages[0], slots=8))[0], messages)


def test_ids_are_kit_numbers_plus_one():
    [by_anchor], _ = decode(MC.replace(b"a0:0", b"a3:2") + b"\n")
    [by_tag], _ = decode(MC.replace(b"a0:0", b"t3:2") + b"\n")
    assert (by_anchor.tag_id, by_anchor.reporter_id) == (4, 3)
    assert (by_tag.tag_id, by_tag.reporter_id) == (4, 4)


def test_the_mask_decides_which_ranges_are_valid():
    [message], _ = decode(MC.replace(b"mc 0f", b"mc 05") + b"\n")
    assert [each.anchor_id for each in message.ranges] == [1, 3]


def test_event_counters_are_no_loss():
    assert decode(b"me" + b" 0000" * 10 + b"\n") == ([], {})


@pytest.mark.parametrize(
    ("line", "kind"),
    [
        (MC.replace(b"c1 ", b""), "field_count"),
        (MC.replace(b" a0:0", b" 00 00 a0:0"), "field_count"),
        (MC.replace(b"00000663", b"0000066"), "field_width"),  # a lost digit would have made 1.635 m into 0.102 m
        (MC.replace(b"mc 0f", b"mc 1f"), "mask"),
        (MA.replace(b"ma 07", b"ma 0f"), "mask"),
        (MC.replace(b"663", b"6g3"), "unrecognised_line"),
        (MC.replace(b"663", b"6\xb63"), "unrecognised_line"),
        (MC[:-1], "unrecognised_line"),
        (b"hello", "unrecognised_line"),
        (b"mc " + b"0 " * 2000, "overlong_line"),
    ],
)
def test_a_damaged_line_is_dropped_and_counted(line, kind):
    messages, losses = decode(line + b"\n" + MC + b"\n")
    assert same(messages, [VECTORS[1][1]])
    assert losses == {kind: 1}


def test_a_range_to_an_anchor_without_a_slot_is_refused():
    message = RangingRound(1, 1, 0, 0, (Range(5, 1.0),), corrected=True)
    with pytest.raises(ValueError, match=r"anchor id 5.*1\.\.4"):
        trek1000.encode_round(message)


millimetres = st.one_of(st.none(), st.integers(-(2**31), 2**31 - 1))


@given(st.lists(millimetres, min_size=4, max_size=4), st.integers(0, 255), st.integers(0, 2**32 - 1), st.booleans())
def test_what_is_encoded_decodes_to_the_same(values_mm, seq, ticks, corrected):
    measured = tuple(Range(i + 1, nan if mm is None else mm / 1000) for i, mm in enumerate(values_mm))
    message = RangingRound(3, 2, seq, ticks if corrected else None, measured, corrected)
    messages, losses = decode(trek1000.encode_round(message))
    valid = tuple(each for each in measured if each.range_m == each.range_m)
    assert same(messages, [RangingRound(3, 2, seq, message.device_ticks, valid, corrected)])
    assert not losses
