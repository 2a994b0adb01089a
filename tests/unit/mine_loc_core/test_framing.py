import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.framing import INCOMPLETE, Damaged, Found, FrameScanner

START = b"\xaa\xbb"
MAX_LENGTH = 20


def parse(buffer, offset):
    """A toy frame: start, length, content, sum of the content."""
    if len(buffer) < offset + 3:
        return INCOMPLETE
    length = buffer[offset + 2]
    if length > MAX_LENGTH:
        return Damaged("length")
    end = offset + 4 + length
    if len(buffer) < end:
        return INCOMPLETE
    content = bytes(buffer[offset + 3 : end - 1])
    if sum(content) & 0xFF != buffer[end - 1]:
        return Damaged("sum")
    return Found(content or None, end - offset)


def frame(content):
    return START + bytes((len(content),)) + content + bytes((sum(content) & 0xFF,))


@pytest.fixture
def scanner():
    return FrameScanner(START, parse)


def test_frames_come_out_in_order_without_losses(scanner):
    assert scanner.feed(frame(b"one") + frame(b"two")) == [b"one", b"two"]
    assert not scanner.losses
    assert scanner.frames == 2


def test_a_good_frame_of_no_interest_is_consumed_and_not_a_loss(scanner):
    assert scanner.feed(frame(b"") + frame(b"x")) == [b"x"]
    assert not scanner.losses
    assert scanner.frames == 2


def test_every_byte_outside_a_frame_is_counted(scanner):
    assert scanner.feed(b"junk" + frame(b"x") + b"more") == [b"x"]
    assert scanner.losses == {"skipped_bytes": 8}


def test_a_frame_beginning_inside_a_broken_one_is_found(scanner):
    broken = START + bytes((15,)) + b"abc"
    assert scanner.feed(broken + frame(b"good") + bytes(12)) == [b"good"]
    assert scanner.losses["sum"] == 1


def test_a_length_beyond_the_cap_is_refused_at_once(scanner):
    assert scanner.feed(START + b"\xff" + frame(b"x")) == [b"x"]
    assert scanner.losses == {"length": 1, "skipped_bytes": 3}


def test_a_start_cut_in_two_is_kept(scanner):
    assert scanner.feed(b"junk" + START[:1]) == []
    assert scanner.feed(START[1:] + b"\x01x" + b"x") == [b"x"]
    assert scanner.losses == {"skipped_bytes": 4}


def test_reset_forgets_a_partial_frame_and_counts_its_bytes(scanner):
    scanner.feed(frame(b"abc")[:4])
    scanner.reset()
    assert scanner.losses == {"skipped_bytes": 4}
    assert scanner.feed(frame(b"x")) == [b"x"]


pieces = st.lists(
    st.one_of(
        st.binary(max_size=12),
        st.binary(min_size=1, max_size=MAX_LENGTH).map(frame),
        st.sampled_from([START, START[:1], START + b"\x05ab", START + b"\xff"]),
    )
).map(b"".join)


@given(pieces, st.lists(st.integers(1, 9), min_size=1))
def test_chunking_changes_neither_frames_nor_losses(stream, sizes):
    whole, chunked = FrameScanner(START, parse), FrameScanner(START, parse)
    expected = whole.feed(stream)
    frames, rest = [], stream
    while rest:
        for size in sizes:
            frames += chunked.feed(rest[:size])
            rest = rest[size:]
    assert frames == expected
    whole.reset()
    chunked.reset()
    assert chunked.losses == whole.losses


@given(pieces)
def test_every_byte_is_either_in_a_frame_or_counted(stream):
    scanner = FrameScanner(START, parse)
    frames = scanner.feed(stream)
    scanner.reset()
    in_frames = sum(map(len, frames)) + 4 * scanner.frames
    assert in_frames + scanner.losses["skipped_bytes"] == len(stream)


@given(st.binary(max_size=40).filter(lambda damage: START[0] not in damage))
def test_a_good_frame_survives_damage_that_holds_no_start(damage):
    scanner = FrameScanner(START, parse)
    assert scanner.feed(damage + frame(b"survivor")) == [b"survivor"]
    assert scanner.losses["skipped_bytes"] == len(damage)
