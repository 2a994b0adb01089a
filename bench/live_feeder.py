"""A process that plays streams into pseudo-terminals and publishes ready-made steps, and notes when it wrote what."""

import heapq
import math
import multiprocessing
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import psutil
from live_streams import RoundKey, Streams, TimedStep

from mine_loc_core.stamps import NS_PER_S
from mine_loc_sim.serial_lines import PseudoSerial

_START_AFTER_NS = NS_PER_S // 10
_LENGTH_VARIANCE_M2, _HEADING_VARIANCE_RAD2 = 0.05**2, 0.05**2


@dataclass(frozen=True, slots=True)
class Fed:
    """When each round was written [time.time_ns()], and what the feeding took."""

    written_ns: dict[RoundKey, int]
    start_ns: int
    cpu_s: float
    latest_s: float
    """Most that a write came after its time."""


def port_of(folder: Path, line: str) -> Path:
    """Where the port of a line is."""
    return folder / line.replace("/", "_")


class Feeder:
    """The process; its ports are there when it is made."""

    def __init__(self, streams: Streams, folder: Path) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_feed, args=(streams, folder, theirs), daemon=True)
        self._process.start()
        self._pipe.recv()

    def start(self) -> None:
        """Begin to play."""
        self._pipe.send(None)

    def finish(self) -> Fed:
        """Wait for the end of the streams."""
        fed: Fed = self._pipe.recv()
        self._process.join()
        return fed

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()
        self._process.join()


def _feed(streams: Streams, folder: Path, pipe: Connection) -> None:
    ports = {line: PseudoSerial(port_of(folder, line)) for line in streams.lines}
    publisher = _step_publisher() if streams.steps else None
    players = [_Player(due, ports, publisher) for due in _schedules(streams)]
    pipe.send("ready")
    pipe.recv()
    process = psutil.Process()
    before = sum(process.cpu_times()[:2])
    start_ns = time.time_ns() + _START_AFTER_NS
    threads = [threading.Thread(target=player.play, args=(start_ns,)) for player in players]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    cpu_s = sum(process.cpu_times()[:2]) - before
    written = {key: at_ns for player in players for key, at_ns in player.written_ns.items()}
    pipe.send(Fed(written, start_ns, cpu_s, max(player.latest_ns for player in players) / NS_PER_S))


def _schedules(streams: Streams) -> list[list[tuple[int, str, Any]]]:
    """What is due on each UWB line, and on all others and as steps together, in order of time."""
    steps = [(step.at_ns, "", step) for step in streams.steps]
    lines = {line: [(write.at_ns, line, write) for write in writes] for line, writes in streams.lines.items()}
    radios = [due for line, due in lines.items() if "/" not in line]
    others = [due for line, due in lines.items() if "/" in line]
    return [*radios, list(heapq.merge(*others, steps, key=lambda item: item[0]))]


class _Player:
    """Plays what is due, and notes when it began to write each round."""

    def __init__(self, due: list[tuple[int, str, Any]], ports: Mapping[str, PseudoSerial], publisher: Any) -> None:
        self._due, self._ports, self._publisher = due, ports, publisher
        self.written_ns: dict[RoundKey, int] = {}
        self.latest_ns = 0

    def play(self, start_ns: int) -> None:
        for at_ns, line, what in self._due:
            wait_ns = start_ns + at_ns - time.time_ns()
            if wait_ns > 0:
                time.sleep(wait_ns / NS_PER_S)
            self.latest_ns = max(self.latest_ns, -wait_ns)
            if isinstance(what, TimedStep):
                self._publisher.publish(_message(what, start_ns))
                continue
            if what.round is not None:
                self.written_ns[what.round] = time.time_ns()
            self._ports[line].write(what.data)


def _step_publisher() -> Any:
    import rclpy  # noqa: PLC0415 a feeder without steps needs no ROS
    from mine_loc_interfaces.msg import Step  # noqa: PLC0415

    from mine_loc_core.nodes.qos import EVENTS  # noqa: PLC0415

    rclpy.init()
    return rclpy.create_node("bench_steps").create_publisher(Step, "pdr/steps", EVENTS)


def _message(timed: TimedStep, start_ns: int) -> Any:
    from mine_loc_interfaces.msg import Step  # noqa: PLC0415

    from mine_loc_core.nodes.conversions import to_point, to_time  # noqa: PLC0415

    message = Step(
        person=timed.person,
        count=timed.count,
        interval=timed.interval_s,
        length=timed.step.length_m,
        length_variance=_LENGTH_VARIANCE_M2,
        heading=math.remainder(timed.step.heading_rad, math.tau),
        heading_variance=_HEADING_VARIANCE_RAD2,
        position=to_point(timed.step.position_m),
        confidence=1.0,
    )
    message.header.stamp = to_time(start_ns + timed.step.stamp_ns)
    message.header.frame_id = f"{timed.person}/odom"
    return message
