from mine_loc_core.framing import Damaged
from mine_loc_core.line_decoder import LineDecoder


def decode_number(line: str) -> int | Damaged | None:
    if line == "idle":
        return None
    return int(line) if line.isdecimal() else Damaged("no_number")


def test_messages_come_in_order_and_losses_are_counted_by_kind():
    reading = LineDecoder(decode_number)
    assert reading.feed(b"1\nidle\nx\n2\ny\n3") == [1, 2]
    assert reading.losses == {"no_number": 2}
    assert reading.feed(b"4\n") == [34]


def test_a_partial_line_does_not_outlive_a_reset():
    reading = LineDecoder(decode_number)
    reading.feed(b"12")
    reading.reset()
    assert reading.feed(b"3\n") == [3]
    assert reading.losses == {"partial_line": 1}
