"""A recorder killed under load, and what is missing from its bag afterwards."""

import contextlib
import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from graph.processes import Running, node_command, running
from mcap.reader import make_reader
from rclpy.context import Context
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rosbags.highlevel import AnyReader
from std_msgs.msg import UInt8MultiArray

from mine_loc_bringup.bags.bag_folder import Storage
from mine_loc_bringup.bags.repair import repair
from mine_loc_core.nodes.qos import EVENTS

RECORDER = "mine_loc_bringup.nodes.recorder"
_DEADLINE_S = 30.0
_TICK_S = 0.002
_NUMBER_BYTES = 8


@dataclass(frozen=True)
class Load:
    """Numbered messages of one size over some topics, in a namespace that is not the recorder's."""

    rate_hz: float = 4000.0
    message_bytes: int = 1000
    topics: int = 4


@dataclass(frozen=True)
class Killed:
    """What became of a recording: the age of the oldest message lost, when the kill came [s], and torn ends of files.

    A file has a torn end where the kill fell into a write; the repaired bag has none.
    """

    published: int
    recovered: int
    gaps: int
    lost_s: float
    torn_ends: int


class Publisher:
    """Publishes a load in step with the clock; the instant of each message is kept."""

    def __init__(self, domain: int, load: Load) -> None:
        self._context = Context()
        self._context.init(domain_id=domain)
        self._node = Node("load", namespace="/elsewhere", context=self._context)
        self._publishers = [
            self._node.create_publisher(UInt8MultiArray, f"load_{index}", EVENTS) for index in range(load.topics)
        ]
        self._load = load
        self._head = serialize_message(UInt8MultiArray(data=bytes(load.message_bytes)))[: -load.message_bytes]
        self._padding = bytes(load.message_bytes - _NUMBER_BYTES)
        self.at_ns: list[int] = []

    def close(self) -> None:
        self._node.destroy_node()
        self._context.try_shutdown()

    @property
    def heard(self) -> bool:
        return all(publisher.get_subscription_count() for publisher in self._publishers)

    def play(self, seconds: float) -> None:
        """Publish for so long."""
        began_s, before = time.monotonic(), len(self.at_ns)
        while (elapsed_s := time.monotonic() - began_s) < seconds:
            for number in range(len(self.at_ns), before + round(elapsed_s * self._load.rate_hz)):
                message = self._head + number.to_bytes(_NUMBER_BYTES, "little") + self._padding
                self.at_ns.append(time.time_ns())
                self._publishers[number % len(self._publishers)].publish(message)
            time.sleep(_TICK_S)


def recorder(folder: Path, domain: int, **parameters: object) -> contextlib.AbstractContextManager[Running]:
    """A recorder of `folder`/bag."""
    return running(node_command(RECORDER, {"bag": folder / "bag"} | parameters), domain, folder / "recorder.log")


def await_heard(publisher: Publisher, run: Running) -> None:
    """Wait until the recorder hears all of the publisher's topics."""
    started_s = time.monotonic()
    while not publisher.heard:
        assert time.monotonic() - started_s < _DEADLINE_S, run.output
        time.sleep(_TICK_S)


def record_and_kill(
    folder: Path, domain: int, storage: Storage, seconds: float, load: Load, split_size_mb: float = 0.0
) -> Killed:
    """Record a load for some seconds, `kill -9`, repair."""
    publisher = Publisher(domain, load)
    try:
        with recorder(folder, domain, storage=storage.value, topics="load_*", split_size_mb=split_size_mb) as run:
            await_heard(publisher, run)
            publisher.play(seconds)
            killed_ns = time.time_ns()
            run.process.send_signal(signal.SIGKILL)
            run.ends()
    finally:
        publisher.close()
    repaired = repair(folder / "bag", folder / "repaired")
    numbers = sorted(numbers_in(folder / "repaired"))
    missing = sorted(set(range(len(publisher.at_ns))) - set(numbers))
    gaps = sum(number < numbers[-1] for number in missing)
    lost_s = (killed_ns - publisher.at_ns[missing[0]]) / 1e9 if missing else 0.0
    torn = sum(part.problem != "" for part in repaired.parts)
    return Killed(len(publisher.at_ns), len(numbers), gaps, lost_s, torn)


def numbers_in(bag: Path) -> Iterator[int]:
    """The numbers of the messages of a bag, read by rosbags, and the files of MCAP by the mcap package too."""
    with AnyReader([bag]) as reader:
        count = 0
        for connection, _, raw in reader.messages():
            count += 1
            yield int.from_bytes(reader.deserialize(raw, connection.msgtype).data[:_NUMBER_BYTES], "little")
    files = sorted(bag.glob("*.mcap"))
    counts = []
    for file in files:
        with file.open("rb") as stream:
            counts.append(sum(1 for _ in make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False)))
    assert not files or sum(counts) == count
