"""A process that subscribes to the graph as other software would, and notes when each message came."""

import math
import multiprocessing
import time
from collections import Counter
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from mine_loc_core.stamps import NS_PER_S

RoundKey = tuple[int, int]


@dataclass(frozen=True, slots=True)
class Seen:
    """What was received: stamps of rounds, and when each stage of a tag's round came [time.time_ns()]."""

    stamps_ns: dict[RoundKey, int]
    arrivals_ns: dict[str, dict[tuple[int, int], int]]
    """By topic: (tag, stamp) of a message to the instant of its (last) arrival."""
    poses: dict[int, list[tuple[int, int, int]]]
    """By tag: stamp of a pose, stamp of the newest UWB measurement in it, and arrival."""


class Watch:
    """The process; it listens to the fused poses and, with `stages`, to what lies before them."""

    def __init__(self, *, stages: bool = False) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_watch, args=(theirs,), kwargs={"stages": stages}, daemon=True)
        self._process.start()
        assert self._process.pid is not None
        self.pid: int = self._process.pid

    def reporting(self) -> int:
        """How many nodes have sent two diagnostics or more."""
        self._pipe.send("reporting")
        count: int = self._pipe.recv()
        return count

    def begin(self) -> None:
        """Hear no diagnostics any more."""
        self._pipe.send("begin")
        self._pipe.recv()

    def finish(self) -> Seen:
        """What was received."""
        self._pipe.send("finish")
        seen: Seen = self._pipe.recv()
        self._process.join()
        return seen

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()
        self._process.join()


def _watch(pipe: Connection, *, stages: bool) -> None:
    import rclpy  # noqa: PLC0415 only this process is a ROS node
    from diagnostic_msgs.msg import DiagnosticArray  # noqa: PLC0415
    from mine_loc_interfaces import msg  # noqa: PLC0415
    from rclpy.experimental import EventsExecutor  # noqa: PLC0415
    from rclpy.serialization import deserialize_message  # noqa: PLC0415

    from mine_loc_core.nodes.qos import EVENTS  # noqa: PLC0415

    rclpy.init()
    node = rclpy.create_node("bench_watch")
    topics: dict[str, type] = {"uwb/ranges": msg.UwbRangeArray, "fused/poses": msg.PersonPoseArray}
    if stages:
        topics |= {"uwb/link_state": msg.LinkStateArray, "uwb/pose": msg.UwbPose, "sync/epochs": msg.Epoch}
    received: list[tuple[str, int, bytes]] = []

    def listen(topic: str, kind: type) -> None:
        def note(data: bytes) -> None:
            received.append((topic, time.time_ns(), data))

        node.create_subscription(kind, topic, note, EVENTS, raw=True)

    for topic, kind in topics.items():
        listen(topic, kind)
    reports: Counter[str] = Counter()
    diagnostics = node.create_subscription(
        DiagnosticArray, "/diagnostics", lambda array: reports.update({s.name.split(":")[0] for s in array.status}), 100
    )
    executor = EventsExecutor()
    executor.add_node(node)
    while True:
        executor.spin_once(timeout_sec=0.1)
        if not pipe.poll():
            continue
        asked = pipe.recv()
        if asked == "reporting":
            pipe.send(sum(count > 1 for count in reports.values()))
        elif asked == "begin":
            node.destroy_subscription(diagnostics)
            received.clear()
            pipe.send(None)
        else:
            pipe.send(
                _seen([(topic, at_ns, deserialize_message(data, topics[topic])) for topic, at_ns, data in received])
            )
            return


def _seen(received: list[tuple[str, int, Any]]) -> Seen:
    from mine_loc_core.stamps import to_stamp_ns  # noqa: PLC0415

    stamps: dict[RoundKey, int] = {}
    arrivals: dict[str, dict[tuple[int, int], int]] = {}
    poses: dict[int, list[tuple[int, int, int]]] = {}
    for topic, at_ns, message in received:
        came = arrivals.setdefault(topic, {})
        if topic == "fused/poses":
            for person in message.people:
                stamp_ns = to_stamp_ns(person.stamp)
                since_ns = round(person.since_uwb * NS_PER_S) if math.isfinite(person.since_uwb) else 0
                poses.setdefault(person.tag_id, []).append((stamp_ns, stamp_ns - since_ns, at_ns))
            continue
        stamp_ns = to_stamp_ns(message.header.stamp)
        if topic in {"sync/epochs", "uwb/link_state"}:
            for each in message.ranges if topic == "sync/epochs" else message.states:
                came[each.tag_id, stamp_ns] = at_ns
            continue
        if topic == "uwb/ranges":
            stamps[message.tag_id, message.seq] = stamp_ns
        came[message.tag_id, stamp_ns] = at_ns
    return Seen(stamps, arrivals, poses)
