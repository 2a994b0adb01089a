from math import isnan, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_uwb.ranging import Range, RangingRound
from mine_loc_uwb.wire import nlink

FRAME = bytes.fromhex(
    "55 05 24 00 02 03 40 e2 01 00 f1 fb 09 00 00 00 00 00 92 13 0201 00 70 0d 00 a3 9e 01 01 17 2f 00 be a9 b0"
)
ROUND = RangingRound(
    4, 4, None, 123_456, (Range(1, 3.44, -81.5, -79.0), Range(2, 12.055, -95.0, -84.5)), corrected=False
)


def decode(*chunks):
    decoder = nlink.NlinkDecoder()
    return [message for chunk in chunks for message in decoder.feed(chunk)], decoder.losses


def with_sum(frame):
    return frame[:-1] + bytes((sum(frame[:-1]) & 0xFF,))


def test_the_published_frame_decodes_and_encodes():
    messages, losses = decode(FRAME)
    assert repr(messages) == repr([ROUND])
    assert not losses
    assert nlink.encode_round(ROUND, system_ms=654_321, supply_mv=5010) == FRAME


def test_only_anchors_are_ranged_to():
    frame = bytearray(FRAME)
    frame[21] = nlink.Role.TAG
    [message], _ = decode(with_sum(bytes(frame)))
    assert [each.anchor_id for each in message.ranges] == [2]


@pytest.mark.parametrize(
    ("index", "value", "kind"), [(2, 0x25, "length"), (20, 3, "length"), (23, 0x71, "checksum"), (35, 0, "checksum")]
)
def test_a_damaged_frame_is_counted_and_the_next_one_found(index, value, kind):
    damaged = FRAME[:index] + bytes((value,)) + FRAME[index + 1 :]
    messages, losses = decode(damaged + FRAME)
    assert repr(messages) == repr([ROUND])
    assert losses == {kind: 1, "skipped_bytes": len(FRAME)}


def test_a_frame_of_an_anchor_is_counted_and_skipped():
    frame = with_sum(FRAME[:4] + bytes((nlink.Role.ANCHOR,)) + FRAME[5:])
    messages, losses = decode(frame + FRAME)
    assert repr(messages) == repr([ROUND])
    assert losses["role"] == 1


half_db = st.integers(-255, -1).map(lambda value: value / 2) | st.just(nan)
millimetres = st.integers(-(2**23), 2**23 - 1).map(lambda value: value / 1000) | st.just(nan)


@given(
    st.lists(st.builds(Range, st.integers(1, 256), millimetres, half_db, half_db), max_size=64),
    st.integers(1, 256),
    st.integers(0, 2**32 - 1),
)
def test_what_is_encoded_decodes_to_the_same_without_failed_ranges(measured, tag_id, ticks):
    message = RangingRound(tag_id, tag_id, None, ticks, tuple(measured), corrected=False)
    messages, losses = decode(nlink.encode_round(message))
    valid = tuple(each for each in measured if not isnan(each.range_m))
    assert repr(messages) == repr([RangingRound(tag_id, tag_id, None, ticks, valid, corrected=False)])
    assert not losses
