"""What `mine-loc up` writes."""

import io

import pytest

from mine_loc_bringup.console import Console
from mine_loc_bringup.supervisor import Event, EventKind


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


class Closed(io.StringIO):
    def write(self, _: str) -> int:
        raise BrokenPipeError


def test_each_line_bears_the_name_of_its_node():
    stream = io.StringIO()
    Console(stream).line("fitter/n100_driver", "hello")
    assert stream.getvalue() == "[fitter/n100_driver] hello\n"


def test_a_terminal_shows_each_node_in_a_colour_of_its_own():
    stream = Terminal()
    console = Console(stream)
    for name in ("a", "b", "a"):
        console.line(name, "x")
    first, second, third = stream.getvalue().splitlines()
    assert first == third
    assert first.split("[a]")[0] != second.split("[b]")[0]


@pytest.mark.parametrize(
    ("event", "text"),
    [
        (Event(EventKind.STARTED, "a", 7), "[a] started"),
        (Event(EventKind.DIED, "a", 7, 3, 0.1), "[a] died, exit status 3; starting it again in 0.1 s"),
        (Event(EventKind.KILLED, "a", 7, -9), "[a] killed, signal 9"),
        (
            Event(EventKind.FAILED, "a", delay_s=0.2, detail="x: gone"),
            "[a] failed: x: gone; starting it again in 0.2 s",
        ),
    ],
)
def test_events_are_told_in_words(event, text):
    stream = io.StringIO()
    Console(stream).event(event)
    assert stream.getvalue() == text + "\n"


def test_a_closed_output_does_not_stop_the_graph():
    Console(Closed()).line("a", "x")
