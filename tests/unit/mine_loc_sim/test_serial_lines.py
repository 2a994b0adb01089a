import os
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from mine_loc_sim.serial_lines import Ahead, Player, PseudoSerial, TcpBridge
from mine_loc_sim.timed_bytes import Arrival, Cable

DEADLINE_S = 10.0


def until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.005)


def test_a_pseudo_terminal_carries_bytes_unchanged(tmp_path: Path):
    line = PseudoSerial(tmp_path / "port")
    reader = os.open(line.address, os.O_RDONLY | os.O_NOCTTY)
    line.write(bytes(range(256)))
    assert os.read(reader, 1000) == bytes(range(256))
    os.close(reader)


def test_an_unplugged_pseudo_terminal_is_gone_and_comes_back_under_its_name(tmp_path: Path):
    line = PseudoSerial(tmp_path / "port")
    line.unplug()
    assert not line.port.exists()
    line.write(b"lost")
    line.plug_in()
    assert line.port.exists()


def test_a_bridge_serves_one_client_and_keeps_its_port_when_it_comes_back():
    bridge = TcpBridge()
    port = int(bridge.address.rpartition(":")[2])
    with socket.create_connection(("127.0.0.1", port), timeout=DEADLINE_S) as client:
        bridge.write(b"hello")
        assert client.recv(100) == b"hello"
        bridge.unplug()
        assert client.recv(100) == b""
    bridge.plug_in()
    assert bridge.address.endswith(str(port))
    bridge.unplug()


class Record:
    """A line that notes what happens to it."""

    address = "nowhere"

    def __init__(self) -> None:
        self.events: list[object] = []

    def plug_in(self) -> None:
        self.events.append(Cable.PLUGGED_IN)

    def unplug(self) -> None:
        self.events.append(Cable.UNPLUGGED)

    def write(self, data: bytes) -> None:
        self.events.append(data)


def test_a_player_does_everything_in_order_and_not_early():
    line = Record()
    arrivals: list[Arrival] = [(0, b"a"), (1, Cable.UNPLUGGED), (2, Cable.PLUGGED_IN), (100_000_000, b"b")]
    player = Player(line, arrivals, speed=2.0)
    start_s = time.monotonic()
    player.start(start_s)
    until(lambda: player.done)
    assert time.monotonic() - start_s >= 0.05
    assert line.events == [b"a", Cable.UNPLUGGED, Cable.PLUGGED_IN, b"b"]
    assert player.played == 2


def test_blocks_are_made_only_a_few_ahead_and_each_line_gets_its_own():
    made: list[int] = []

    def blocks() -> Iterator[dict[str, list[Arrival]]]:
        for number in range(50):
            made.append(number)
            yield {"one": [(number, b"1")], "two": [(number, b"2")]}

    ahead = Ahead(blocks(), ("one", "two"))
    assert ahead.wait_ready(DEADLINE_S)
    one, two = ahead.arrivals("one"), ahead.arrivals("two")
    assert next(one) == (0, b"1")
    assert len(made) < 10
    pairs = [(0, b"2")] if next(two) == (0, b"2") else []
    for a, b in zip(one, two, strict=True):
        pairs.append(b)
        assert a[0] == b[0]
    assert len(pairs) == 50


def test_a_scene_that_breaks_ends_its_lines_and_says_why():
    def blocks() -> Iterator[dict[str, list[Arrival]]]:
        yield {"one": [(0, b"1")]}
        raise ValueError("broken")

    ahead = Ahead(blocks(), ("one",))
    assert list(ahead.arrivals("one")) == [(0, b"1")]
    with pytest.raises(ValueError, match="broken"):
        raise ahead.problem or AssertionError("no problem told")
