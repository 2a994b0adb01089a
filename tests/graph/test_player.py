"""The player: what it plays, in which order and with what, and what it says of bags that cannot be played."""

import itertools
import os
import pty
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from graph.observer import Observer
from graph.processes import Running, running
from rclpy.serialization import serialize_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Int32, String

from mine_loc_bringup.bags.bag_folder import BagFolder, Storage
from mine_loc_bringup.bags.message_definitions import MessageDefinitions
from mine_loc_bringup.bags.topic import BagTopic
from mine_loc_bringup.nodes.bag_qos import to_bag
from mine_loc_core.nodes.qos import EVENTS, LATCHED
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S, to_stamp_ns

pytestmark = pytest.mark.graph

START_NS = 1_000 * NS_PER_S
BEAT_MS, BEATS = 10, 200


def command(bag: Path, *more: str) -> list[str]:
    return [sys.executable, "-m", "mine_loc_bringup.main", "replay", str(bag), *more]


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bag(tmp_path_factory.mktemp("player") / "bag", Storage.MCAP)


def write_bag(path: Path, storage: Storage) -> Path:
    """Two seconds of beats, a map latched at the beginning, and a pose that the graph makes."""
    definitions = MessageDefinitions()
    text, text_hash = definitions.find("std_msgs/msg/String")
    number, number_hash = definitions.find("std_msgs/msg/Int32")
    folder = BagFolder(path, storage)
    folder.add_topic(BagTopic("/map", "std_msgs/msg/String", text, text_hash, to_bag([LATCHED]), 1))
    folder.add_topic(BagTopic("/beat", "std_msgs/msg/Int32", number, number_hash, to_bag([EVENTS])))
    folder.add_topic(BagTopic("/fused/poses", "std_msgs/msg/Int32", number, number_hash, to_bag([EVENTS])))
    folder.add_topic(BagTopic("/other", "std_msgs/msg/Int32", number, "RIHS01_of_another_version"))
    folder.add_topic(BagTopic("/absent", "absent_msgs/msg/Thing", "int32 x\n", "RIHS01_absent"))
    folder.write("/map", START_NS, serialize_message(String(data="north")))
    for index in range(BEATS):
        stamp_ns = START_NS + index * BEAT_MS * NS_PER_MS
        for topic in ("/beat", "/fused/poses", "/other", "/absent"):
            folder.write(topic, stamp_ns, serialize_message(Int32(data=index)))
    folder.close()
    return path


class Played:
    """What was heard of a replay."""

    def __init__(self, observer: Observer, run: Running) -> None:
        self.run = run
        self.beats = observer.listen(Int32, "/beat")
        self.poses = observer.listen(Int32, "/fused/poses")
        self.clock = observer.listen(Clock, "/clock")
        self.maps = observer.listen(String, "/map", LATCHED)
        self.observer = observer

    def to_the_end(self) -> "Played":
        self.observer.wait_for(lambda: not self.run.alive, 30.0, "the end")
        return self

    @property
    def clock_ns(self) -> list[int]:
        return [to_stamp_ns(message.clock) for message in self.clock.messages]


@pytest.fixture
def play(bag: Path, observer: Observer, domain: int, tmp_path: Path) -> Iterator[Any]:
    started = []

    def start(*more: str) -> Played:
        context = running(command(bag, "--live", *more), domain, tmp_path / "log")
        started.append(context)
        return Played(observer, context.__enter__())

    yield start
    for context in started:
        context.__exit__(None, None, None)


def test_the_inputs_are_played_in_order_with_the_clock_and_what_the_graph_makes_is_not(play):
    played = play().to_the_end()
    assert played.run.ends() == 0
    assert [message.data for message in played.beats.messages] == list(range(BEATS))
    assert [message.data for message in played.maps.messages] == ["north"]
    assert not len(played.poses)
    stamps = played.clock_ns
    assert stamps == sorted(stamps)
    assert (stamps[0], stamps[-1]) == (START_NS, START_NS + (BEATS - 1) * BEAT_MS * NS_PER_MS)
    assert max(after - before for before, after in itertools.pairwise(stamps)) <= 60 * NS_PER_MS
    assert played.run.output.count("/other: not played: std_msgs/msg/Int32: another version is installed here") == 1
    assert played.run.output.count("/absent: not played: absent_msgs/msg/Thing: its definition is not installed") == 1


def test_a_database_is_played_too(domain, observer, tmp_path):
    bag = write_bag(tmp_path / "bag", Storage.SQLITE3)
    with running(command(bag, "--live", "--start", "1", "--rate", "4"), domain, tmp_path / "log") as run:
        played = Played(observer, run).to_the_end()
    assert [message.data for message in played.beats.messages] == list(range(100, BEATS))
    assert [message.data for message in played.maps.messages] == ["north"]


def test_topics_by_pattern_override_what_is_played(play):
    played = play("--topics", "fused/*", "--rate", "10").to_the_end()
    assert len(played.poses) == BEATS
    assert not len(played.beats)


def test_a_replay_from_later_on_has_the_latched_messages_of_before(play):
    played = play("--start", "1.5").to_the_end()
    assert [message.data for message in played.beats.messages] == list(range(150, BEATS))
    assert [message.data for message in played.maps.messages] == ["north"]
    assert played.clock_ns[0] == START_NS + 1500 * NS_PER_MS


@pytest.mark.parametrize("rate", [0.5, 4.0])
def test_the_rate_is_kept(play, rate):
    played = play("--rate", str(rate), "--start", "1.5").to_the_end()
    took_s = played.beats.at_s[-1] - played.beats.at_s[0]
    lasts_s = 0.49 / rate
    assert lasts_s - 0.1 < took_s < lasts_s + 2.0
    assert len(played.beats) == 50


def test_a_loop_plays_all_again_from_the_beginning(play):
    played = play("--loop", "--rate", "4")
    played.observer.wait_for(lambda: len(played.beats) > 2 * BEATS, 30.0, "the third time")
    numbers = [message.data for message in played.beats.messages]
    assert numbers[: 2 * BEATS] == list(range(BEATS)) * 2
    assert played.run.stop() < 2.0


def test_the_space_bar_of_a_terminal_goes_on_and_pauses(bag, observer, domain):
    clock = observer.listen(Clock, "/clock")
    terminal, theirs = pty.openpty()
    with subprocess.Popen(
        command(bag, "--live", "--paused", "--loop"), stdin=theirs, env=os.environ | {"ROS_DOMAIN_ID": str(domain)}
    ) as player:
        try:
            observer.wait_for(lambda: len(clock) > 200, what="the clock")
            assert {to_stamp_ns(message.clock) for message in clock.messages} == {START_NS}
            os.write(terminal, b"x ")
            observer.wait_for(lambda: to_stamp_ns(clock.messages[-1].clock) > START_NS, what="a clock that moves")
            os.write(terminal, b" ")
            observer.wait_for(
                lambda: len({to_stamp_ns(each.clock) for each in clock.messages[-20:]}) == 1, what="a pause"
            )
        finally:
            player.send_signal(signal.SIGINT)
            player.wait(timeout=10.0)
    os.close(theirs)
    os.close(terminal)
    assert player.returncode == 0


def test_what_cannot_be_played_is_refused_in_one_line(bag, domain, tmp_path):
    whole = (bag / "bag_0.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(whole[: len(whole) // 2])
    refusals = {
        (str(tmp_path / "none"), "--live"): "none: cannot be read as a bag",
        (str(tmp_path / "cut.mcap"), "--live"): "mine-loc bag repair",
        (str(tmp_path), "--live"): "mine-loc bag repair",
        (str(bag), "--live", "--topics", "nowhere"): "nowhere: no such topic in",
        (str(bag), "--live", "--topics", "absent"): "nothing to play; allowed: --topics",
        (str(bag), "--live", "--start", "5"): "start_offset_s: 5; allowed: 0 to 2.0",
        (str(bag), "--live", "--out", "x"): "--out: x; allowed: without --live",
    }
    for words, refusal in refusals.items():
        with running(command(Path(words[0]), *words[1:]), domain, tmp_path / "log") as run:
            assert run.ends() == 2, words
        assert sum(refusal in line for line in run.output.splitlines()) == 1, run.output
        assert "Traceback" not in run.output
