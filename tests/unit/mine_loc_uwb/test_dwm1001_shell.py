import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_uwb.ranging import DevicePosition, Range, RangingRound
from mine_loc_uwb.wire import dwm1001_shell

LEC = (
    b"DIST,4,AN0,022E,7.94,8.03,0.00,3.44,AN1,9280,7.95,0.00,0.00,5.68,AN2,DCAE,0.00,8.03,0.00,7.76,"
    b"AN3,5431,0.00,0.00,0.00,8.73,POS,6.95,5.37,-1.97,52"
)
LES = (
    b"022E[7.94,8.03,0.00]=3.38 9280[7.95,0.00,0.00]=5.49 DCAE[0.00,8.03,0.00]=7.73 5431[0.00,0.00,0.00]=9.01 "
    b"le_us=3082 est[6.97,5.17,-1.77,53]"
)
LEP = b"POS,7.10,5.24,-2.03,53"
LISTENER = b"POS,0,1A2B,1.20,-3.40,0.50,97,x0F"
ANCHORS_M = {0x022E: (7.94, 8.03, 0), 0x9280: (7.95, 0, 0), 0xDCAE: (0, 8.03, 0), 0x5431: (0, 0, 0)}


def ranging(values_m, position):
    measured = tuple(Range(anchor, value) for anchor, value in zip(ANCHORS_M, values_m, strict=False))
    return RangingRound(0, 0, None, None, measured, corrected=True, device_position=position)


LEC_ROUND = ranging((3.44, 5.68, 7.76, 8.73), DevicePosition(0, 6.95, 5.37, -1.97, 52))
LES_ROUND = ranging((3.38, 5.49, 7.73, 9.01), DevicePosition(0, 6.97, 5.17, -1.77, 53))


def decode(*chunks):
    decoder = dwm1001_shell.decoder()
    return [message for chunk in chunks for message in decoder.feed(chunk)], decoder.losses


def same(a, b):
    return repr(a) == repr(b)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (LEC, LEC_ROUND),
        (LES, LES_ROUND),
        (LEP, DevicePosition(0, 7.10, 5.24, -2.03, 53)),
        (LISTENER, DevicePosition(0x1A2B, 1.2, -3.4, 0.5, 97)),
        (LEC[: LEC.index(b",POS")], ranging((3.44, 5.68, 7.76, 8.73), None)),
        (LES[: LES.index(b" est")], ranging((3.38, 5.49, 7.73, 9.01), None)),
        (b"DIST,0", ranging((), None)),
        (b"DIST,0,POS,6.95,5.37,-1.97,52", ranging((), LEC_ROUND.device_position)),
        (b"le_us=12", ranging((), None)),
    ],
)
def test_published_lines_decode(line, expected):
    messages, losses = decode(line + b"\r\n")
    assert same(messages, [expected])
    assert not losses


def test_published_lines_encode():
    assert dwm1001_shell.encode_lec(LEC_ROUND, ANCHORS_M) == LEC + b"\r\n"
    assert dwm1001_shell.encode_les(LES_ROUND, ANCHORS_M, solve_us=3082) == LES + b"\r\n"
    assert dwm1001_shell.encode_lep(DevicePosition(0, 7.10, 5.24, -2.03, 53)) == LEP + b"\r\n"


@pytest.mark.parametrize("chatter", [b"dwm> lec\r\n", b"\r\n", b"dwm> ", b"DWM1001 TWR Real Time Location System\r\n"])
def test_prompt_echo_and_banner_are_no_loss(chatter):
    messages, losses = decode(chatter + LEC + b"\r\n")
    assert same(messages, [LEC_ROUND])
    assert not losses


def test_a_line_whose_predecessor_lost_its_end_is_found():
    messages, losses = decode(LEC[:70] + LEC + b"\n")
    assert same(messages, [LEC_ROUND])
    assert losses == {"field_count": 1}


@pytest.mark.parametrize(
    ("line", "kind"),
    [
        (LEC.replace(b"DIST,4", b"DIST,3"), "field_count"),
        (LEC.replace(b"DIST,4", b"DIST,x"), "field_count"),
        (LEC.replace(b",0.00,3.44", b",3.44"), "field_count"),
        (LEC.replace(b"3.44", b"3.4"), "field_value"),
        (LEC.replace(b"3.44", b"nan"), "field_value"),
        (LEC.replace(b"022E", b"22E"), "field_value"),
        (LEC.replace(b"AN2", b"AN1"), "field_value"),
        (LEC.replace(b",52", b",152"), "field_value"),
        (LES.replace(b"]=3.38", b"]3.38"), "field_value"),
        (LES.replace(b"est[", b"est"), "field_value"),
        (LEP.replace(b"7.10", b"7:10"), "field_value"),
        (b"unknown command", "unrecognised_line"),
        (b"DIST,4," + b"9" * 5000, "overlong_line"),
    ],
)
def test_a_garbled_line_is_dropped_whole_and_counted(line, kind):
    messages, losses = decode(line + b"\r\n" + LEC + b"\r\n")
    assert same(messages, [LEC_ROUND])
    assert losses == {kind: 1}


centimetres = st.integers(-99_999, 99_999).map(lambda cm: cm / 100)
points = st.tuples(centimetres, centimetres, centimetres)
positions = st.builds(DevicePosition, st.just(0), centimetres, centimetres, centimetres, st.integers(0, 100))
rounds = st.builds(
    lambda ids, values, position: RangingRound(
        0, 0, None, None, tuple(map(Range, ids, values)), corrected=True, device_position=position
    ),
    st.lists(st.integers(1, 0xFFFF), max_size=4, unique=True),
    st.lists(centimetres, min_size=4, max_size=4),
    st.none() | positions,
)


@given(rounds, points)
def test_what_is_encoded_decodes_to_the_same(message, point):
    anchors = {each.anchor_id: point for each in message.ranges}
    lines = dwm1001_shell.encode_lec(message, anchors) + dwm1001_shell.encode_les(message, anchors, solve_us=1)
    messages, losses = decode(lines)
    assert same(messages, [message, message])
    assert not losses
