from math import isnan, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_uwb.ranging import Range, RangingRound
from mine_loc_uwb.wire import arduino

FROM = b"from: 1782\t Range: 1.23 m\t RX power: -78.45 dBm"
LINKS = b'{"links":[{"A":"1782","R":"1.2"},{"A":"1783","R":"10.0"}]}'


def ranging(*ranges, tag_id=0, seq=None):
    return RangingRound(tag_id, 0, seq, None, ranges, corrected=False)


FROM_ROUND = ranging(Range(0x1782, 1.23, receive_power_dbm=-78.45))
LINKS_ROUND = ranging(Range(0x1782, 1.2), Range(0x1783, 10.0))


def decode(*chunks):
    decoder = arduino.decoder()
    return [message for chunk in chunks for message in decoder.feed(chunk)], decoder.losses


def same(a, b):
    return repr(a) == repr(b)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (FROM, FROM_ROUND),
        (b"from: 1782\tRange: 1.23 m\tRX power: -78.45 dBm", FROM_ROUND),
        (b"from: 1782\t Range: 1.23 m", ranging(Range(0x1782, 1.23))),
        (b"from: 1782\t Range: 1.23 m\t RX power: inf dBm", ranging(Range(0x1782, 1.23))),
        (b"from: 83\t Range: -0.07 m\t RX power: -78.45 dBm", ranging(Range(0x83, -0.07, receive_power_dbm=-78.45))),
        (LINKS, LINKS_ROUND),
        (b'{"links": []}', ranging()),
        (b"T:144235622:RR:0:2:950:950:118:1910", ranging(Range(3, 0.95), tag_id=1, seq=118)),
        (b"Distance : 2.345678", ranging(Range(0, 2.345678))),
    ],
)
def test_published_lines_decode(line, expected):
    messages, losses = decode(line + b"\r\n")
    assert same(messages, [expected])
    assert not losses


def test_published_lines_encode():
    assert arduino.encode_from(FROM_ROUND.ranges[0]) == FROM + b"\r\n"
    assert arduino.encode_from(Range(0x1782, 1.23)) == b"from: 1782\t Range: 1.23 m\r\n"
    assert arduino.encode_links(LINKS_ROUND) == LINKS
    report = ranging(Range(3, 0.95), tag_id=1, seq=118)
    assert arduino.encode_report(report, time=144235622) == b"T:144235622:RR:0:2:950:950:118:0\r\n"
    assert arduino.encode_distance(2.345678) == b"Distance : 2.345678\r\n"


def test_json_needs_no_line_end():
    messages, _ = decode(LINKS, LINKS)
    assert same(messages, [LINKS_ROUND, LINKS_ROUND])


@pytest.mark.parametrize(
    "event",
    [
        b"blink; 1 device added ! ->  short:1782",
        b"ranging init; 1 device added ! ->  short:1782",
        b"delete inactive device: 1782",
    ],
)
def test_events_are_no_loss(event):
    assert decode(event + b"\r\n") == ([], {})


@pytest.mark.parametrize(
    ("line", "kind"),
    [
        (b"from: 1782\t Range: 1.2", "unrecognised_line"),
        (b"from: 17G2\t Range: 1.23 m", "unrecognised_line"),
        (b"from: 1782\t Range: nan m", "unrecognised_line"),
        (b"from: 1782\t Range: 1.23 m\t RX pow", "unrecognised_line"),
        (b"T:144235622:RR:0:2:950:951:118:1910", "check"),
        (b'{"links":[{"A":"1782","R":"1.2"}', "json"),
        (b'{"links":[{"A":"1782"}]}', "json"),
        (b'{"links":[{"A":1782,"R":"1.2"}]}', "json"),
        (b'{"links":7}', "json"),
        (b'{"links":[{"A":"1782","R":"1e999"}]}', "field_value"),
        (b'{"links":' + b"[" * 1000, "json"),
        (b'{"links":' + b"[" * 2000, "overlong_line"),
    ],
)
def test_a_damaged_line_is_dropped_and_counted(line, kind):
    messages, losses = decode(line + b"\n" + FROM + b"\n")
    assert same(messages, [FROM_ROUND])
    assert losses == {kind: 1}


centimetres = st.integers(-99_999, 99_999).map(lambda cm: cm / 100)
decimetres = st.integers(-9_999, 9_999).map(lambda dm: dm / 10)


@given(st.builds(Range, st.integers(1, 0xFFFF), centimetres, receive_power_dbm=centimetres | st.just(nan)))
def test_an_encoded_range_decodes_to_the_same(measured):
    messages, losses = decode(arduino.encode_from(measured))
    assert same(messages, [ranging(measured)])
    assert not losses


@given(st.lists(st.builds(Range, st.integers(1, 2**64 - 1), decimetres | st.just(nan)), max_size=8))
def test_encoded_links_decode_to_the_same_without_failed_ranges(measured):
    messages, losses = decode(arduino.encode_links(ranging(*measured)))
    assert same(messages, [ranging(*(each for each in measured if not isnan(each.range_m)))])
    assert not losses
