"""One thread for all ports: what one of them does is nothing to the others."""

import os
import queue

import pytest

from mine_loc_core.port_reader import port_reader

DEADLINE_S = 5.0


class Line:
    """A pipe whose far end is read by the port reader; what is told goes into queues."""

    def __init__(self, take=None) -> None:
        self.descriptor, self._end = os.pipe()
        self.heard: queue.Queue[bytes] = queue.Queue()
        self.problems: queue.Queue[str] = queue.Queue()
        port_reader().add(self.descriptor, take or self.heard.put, self.problems.put)

    def write(self, data: bytes) -> None:
        os.write(self._end, data)

    def hang_up(self) -> None:
        os.close(self._end)


def test_what_arrives_on_each_port_is_handed_to_its_owner():
    lines = [Line() for _ in range(3)]
    for number, line in enumerate(lines):
        line.write(bytes([number]))
    assert [line.heard.get(timeout=DEADLINE_S) for line in lines] == [b"\0", b"\1", b"\2"]


def test_a_port_that_ends_is_told_once_and_the_others_are_read_on():
    ended, other = Line(), Line()
    ended.hang_up()
    assert ended.problems.get(timeout=DEADLINE_S) == "closed by the other side"
    other.write(b"on")
    assert other.heard.get(timeout=DEADLINE_S) == b"on"
    assert ended.problems.empty()


def test_an_owner_that_fails_loses_its_port_alone():
    def fail(data: bytes) -> None:
        raise ValueError(data)

    failing, other = Line(fail), Line()
    failing.write(b"x")
    assert failing.problems.get(timeout=DEADLINE_S) == "ValueError(b'x')"
    other.write(b"on")
    assert other.heard.get(timeout=DEADLINE_S) == b"on"


def test_nothing_is_told_of_a_port_that_was_removed():
    removed, other = Line(), Line()
    port_reader().remove(removed.descriptor)
    removed.write(b"late")
    other.write(b"on")
    assert other.heard.get(timeout=DEADLINE_S) == b"on"
    assert removed.heard.empty()
    assert removed.problems.empty()


def test_what_cannot_be_waited_for_is_refused(tmp_path):
    with (tmp_path / "file").open("wb") as file, pytest.raises(OSError, match="not permitted"):
        port_reader().add(file.fileno(), print, print)
