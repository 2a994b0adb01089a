"""Serial lines that are not there."""

import os
import threading
import time

from mine_loc_core.stamps import NS_PER_S
from mine_loc_sim.serial_lines import Player, PseudoSerial

PATIENCE_S = 10.0


def read(descriptor, count):
    """Exactly `count` bytes; the test's own time limit ends a wait for bytes that never come."""
    data = b""
    while len(data) < count:
        data += os.read(descriptor, count - len(data))
    return data


def test_bytes_pass_both_ways_unchanged(tmp_path):
    line = PseudoSerial(tmp_path / "deep" / "port")
    device = os.open(line.port, os.O_RDWR | os.O_NOCTTY)
    sent = bytes(range(256))
    line.write(sent)
    assert read(device, 256) == sent
    assert line.read() == b""
    os.write(device, sent)
    deadline, received = time.monotonic() + PATIENCE_S, b""
    while received != sent:
        received += line.read()
        assert time.monotonic() < deadline
    os.close(device)
    line.unplug()


def test_an_unplugged_line_is_gone_takes_bytes_silently_and_comes_back(tmp_path):
    line = PseudoSerial(tmp_path / "port")
    line.unplug()
    assert not line.port.is_symlink()
    line.write(b"lost")
    assert line.read() == b""
    line.plug_in()
    device = os.open(line.port, os.O_RDWR | os.O_NOCTTY)
    line.write(b"here")
    assert read(device, 4) == b"here"
    os.close(device)
    line.unplug()


def test_what_nobody_reads_does_not_block_the_player(tmp_path):
    line = PseudoSerial(tmp_path / "port")
    for _ in range(100):
        line.write(bytes(4096))
    line.unplug()


def test_a_message_longer_than_the_terminal_holds_arrives_whole_as_it_is_read(tmp_path):
    line, sent = PseudoSerial(tmp_path / "port"), bytes(range(256)) * 1024
    device = os.open(line.port, os.O_RDWR | os.O_NOCTTY)
    writer = threading.Thread(target=line.write, args=(sent,))
    writer.start()
    assert read(device, len(sent)) == sent
    writer.join(PATIENCE_S)
    os.close(device)
    line.unplug()


def test_bursts_are_played_in_order_not_before_their_time(tmp_path):
    line = PseudoSerial(tmp_path / "port")
    device = os.open(line.port, os.O_RDWR | os.O_NOCTTY)
    player = Player(line, [(0, b"a"), (50_000_000, b"b"), (100_000_000, b"c")])
    start_s = time.monotonic()
    player.start(start_s)
    assert read(device, 3) == b"abc"
    assert time.monotonic() >= start_s + 0.1
    os.close(device)
    line.unplug()


def test_a_stopped_player_falls_silent_and_ends(tmp_path):
    line, before = PseudoSerial(tmp_path / "port"), set(threading.enumerate())
    player = Player(line, [(0, b"a"), (3600 * NS_PER_S, b"b")])
    player.start(time.monotonic())
    (thread,) = set(threading.enumerate()) - before
    player.stop()
    thread.join(PATIENCE_S)
    assert not thread.is_alive()
    assert player.played <= 1
    line.unplug()
