import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_uwb.ranging import AnchorRange, AnchorRanging, DevicePosition, Range, RangingRound
from mine_loc_uwb.wire import dwm1001_tlv

REPLY = bytes.fromhex(
    "40 01 00 41 0d ba 04 00 00 ce ff ff ff fb 00 00 00 57 49 29 02"
    "2e 02 70 0d 00 00 64 04 1f 00 00 5e 1f 00 00 00 00 00 00 64"
    "80 92 30 16 00 00 64 0e 1f 00 00 00 00 00 00 00 00 00 00 64"
)
ANCHORS_M = {0x022E: (7.94, 8.03, 0.0), 0x9280: (7.95, 0.0, 0.0)}
POSITION = DevicePosition(0, 1.210, -0.050, 0.251, 87)
ROUND = RangingRound(
    0, 0, None, None, (Range(0x022E, 3.44), Range(0x9280, 5.68)), corrected=True, device_position=POSITION
)


def decode(*chunks):
    decoder = dwm1001_tlv.TlvDecoder()
    return [message for chunk in chunks for message in decoder.feed(chunk)], decoder.losses


def same(a, b):
    return repr(a) == repr(b)


def test_the_reply_of_a_tag_decodes_and_encodes():
    messages, losses = decode(REPLY)
    assert same(messages, [ROUND])
    assert not losses
    assert dwm1001_tlv.encode_tag_reply(ROUND, ANCHORS_M) == REPLY


def test_the_reply_of_an_anchor_decodes_and_encodes():
    ranging = AnchorRanging(0, None, None, (AnchorRange(0, 0xDECA0000_00009280, 5.68),))
    reply = REPLY[:18] + bytes.fromhex("48 0e 01 80 92 00 00 00 00 ca de 30 16 00 00 64")
    assert decode(reply) == ([ranging], {})
    assert dwm1001_tlv.encode_anchor_reply(ranging, POSITION) == reply


def test_a_reply_without_a_list_ends_where_the_next_begins():
    messages, losses = decode(REPLY[:18] + REPLY)
    assert same(messages, [POSITION, ROUND])
    assert not losses


def test_a_round_without_a_position_cannot_be_encoded():
    with pytest.raises(ValueError, match="device position"):
        dwm1001_tlv.encode_tag_reply(RangingRound(0, 0, None, None, (), corrected=True), {})


def changed(index, value):
    return REPLY[:index] + bytes((value,)) + REPLY[index + 1 :]


@pytest.mark.parametrize(
    ("reply", "kind"),
    [
        (b"\x40\x01\x01", "device_error"),
        (changed(2, 9), "error_code"),
        (changed(3, 0x42), "type"),
        (changed(18, 0x4A), "type"),
        (changed(17, 101), "quality"),
        (changed(27, 101), "entry"),
        (changed(19, 0x28), "length"),
        (changed(20, 3), "length"),
        (changed(26, 0x7F), "entry"),
        (REPLY[:30], "interrupted"),
    ],
)
def test_a_damaged_reply_is_counted_and_the_next_one_found(reply, kind):
    messages, losses = decode(reply + REPLY)
    assert same(messages, [ROUND])
    assert losses[kind] == 1
    assert losses["skipped_bytes"] == len(reply)


@pytest.mark.parametrize("cut", range(1, len(REPLY)))
def test_a_reply_cut_short_anywhere_yields_no_wrong_range(cut):
    messages, _ = decode(REPLY[:cut] + REPLY)
    assert same([message for message in messages if isinstance(message, RangingRound)], [ROUND])


millimetres = st.integers(-(10**6), 10**6).map(lambda mm: mm / 1000)
entries = st.lists(
    st.builds(Range, st.integers(1, 0xFFFF), st.integers(0, 10**6).map(lambda mm: mm / 1000)), max_size=4
)


@given(entries, st.builds(DevicePosition, st.just(0), millimetres, millimetres, millimetres, st.integers(0, 100)))
def test_what_is_encoded_decodes_to_the_same(ranges, position):
    message = RangingRound(0, 0, None, None, tuple(ranges), corrected=True, device_position=position)
    anchors = {each.anchor_id: (position.x_m, position.y_m, position.z_m) for each in ranges}
    messages, losses = decode(dwm1001_tlv.encode_tag_reply(message, anchors))
    assert same(messages, [message])
    assert not losses
