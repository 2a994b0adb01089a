import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.line_splitter import LINE_END, LineSplitter

BOUNDARY = LINE_END + rb"|(?=mc )|(?<=\]\})"
MAX_LENGTH = 40


@pytest.fixture
def splitter():
    return LineSplitter(BOUNDARY, MAX_LENGTH)


@pytest.mark.parametrize("end", [b"\n", b"\r", b"\r\n", b"\n\r", b"\0", b"  \r\n", b"\r\n\r\n"])
def test_any_line_end_ends_a_line(splitter, end):
    assert splitter.feed(b"one" + end + b"two" + end) == ["one", "two"]
    assert not splitter.losses


def test_a_line_waits_for_its_end(splitter):
    assert splitter.feed(b"on") == []
    assert splitter.feed(b"e\n") == ["one"]


def test_a_start_splits_where_the_line_end_was_lost(splitter):
    assert splitter.feed(b"mc 01mc 02\n") == ["mc 01", "mc 02"]


def test_an_end_mark_completes_a_line_at_once(splitter):
    assert splitter.feed(b'{"links":[]}') == ['{"links":[]}']


def test_bytes_that_are_no_ascii_become_replacement_characters(splitter):
    assert splitter.feed(b"1\xff2\n") == ["1\ufffd2"]


def test_an_overlong_line_is_dropped_whole_and_counted_once(splitter):
    assert splitter.feed(b"x" * 1000 + b" tail\nnext\n") == ["next"]
    assert splitter.losses == {"overlong_line": 1}


def test_memory_stays_bounded_on_a_stream_without_line_ends(splitter):
    for _ in range(1000):
        splitter.feed(b"y" * 100)
        assert len(splitter._tail) <= MAX_LENGTH + LineSplitter.CONTEXT
    assert splitter.losses == {"overlong_line": 1}


def test_reset_forgets_a_partial_line_and_counts_it(splitter):
    splitter.feed(b"half a li")
    splitter.reset()
    assert splitter.feed(b"one\n") == ["one"]
    assert splitter.losses == {"partial_line": 1}


def test_a_line_of_full_length_survives_a_start_that_comes_in_pieces(splitter):
    lines = [line for byte in b"z" * (MAX_LENGTH - 1) + b"mc 1\n" for line in splitter.feed(bytes([byte]))]
    assert lines == ["z" * (MAX_LENGTH - 1), "mc 1"]
    assert not splitter.losses


pieces = st.lists(
    st.one_of(
        st.binary(max_size=12),
        st.sampled_from([b"mc 12", b"\r\n", b"\n", b"m", b"mc", b"]}", b"]", b"\0", b" ", b"z" * (MAX_LENGTH - 1)]),
    )
).map(b"".join)


@given(pieces, st.lists(st.integers(1, 60), min_size=1))
def test_chunking_changes_neither_lines_nor_losses(stream, sizes):
    whole, chunked = LineSplitter(BOUNDARY, MAX_LENGTH), LineSplitter(BOUNDARY, MAX_LENGTH)
    expected = whole.feed(stream)
    lines, rest = [], stream
    while rest:
        for size in sizes:
            lines += chunked.feed(rest[:size])
            rest = rest[size:]
    assert lines == expected
    assert chunked.losses == whole.losses
