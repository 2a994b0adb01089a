"""The demonstration's subscriber: what other software would see of the graph, kept for the table, report and bag."""

import threading
import time
from collections import Counter, defaultdict, deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from mine_loc_interfaces import msg
from nav_msgs.msg import Odometry
from rclpy.experimental import EventsExecutor
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import Imu, MagneticField
from tf2_msgs.msg import TFMessage

from mine_loc_bringup.bag_writer import BagWriter
from mine_loc_core.nodes.qos import EVENTS, LATCHED, STREAM
from mine_loc_core.stamps import to_stamp_ns

_RATE_WINDOW_S = 3.0


@dataclass(frozen=True, slots=True)
class Output:
    """One fused pose as received."""

    received_ns: int
    stamp_ns: int
    x_m: float
    y_m: float
    covariance_m2: tuple[float, float, float]  # xx, xy, yy
    ce95_m: float
    mode: int
    los_fraction: float


@dataclass(slots=True)
class Watched:
    """What was received so far."""

    outputs: dict[str, list[Output]] = field(default_factory=lambda: defaultdict(list))
    rounds: Counter[int] = field(default_factory=Counter)
    reports: Counter[str] = field(default_factory=Counter)
    """Diagnostics received of each node."""
    arrivals: dict[str, deque[float]] = field(default_factory=lambda: defaultdict(lambda: deque(maxlen=1000)))

    def rate_hz(self, topic: str) -> float:
        """Messages a second on a topic over the last seconds."""
        since_s = time.monotonic() - _RATE_WINDOW_S
        return sum(at_s > since_s for at_s in list(self.arrivals[topic])) / _RATE_WINDOW_S


class DemoWatch:
    """Subscribes to everything the graph says, in a thread of its own, and writes it all to a bag."""

    def __init__(self, people: Iterable[str], bag: Path) -> None:
        self.watched = Watched()
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node("demo_watch", context=self._context)
        self._bag = BagWriter(bag)
        for kind, topic, qos in [*_TOPICS, *[item for person in people for item in _person_topics(person)]]:
            self._subscribe(kind, topic, qos)
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop listening and finish the bag."""
        self._context.try_shutdown()
        self._thread.join(timeout=3.0)
        self._bag.close()

    def _spin(self) -> None:
        executor = EventsExecutor(context=self._context)
        executor.add_node(self._node)
        while self._context.ok():
            try:
                executor.spin_once(timeout_sec=0.2)
            except rclpy.executors.ExternalShutdownException:
                return

    def _subscribe(self, kind: type, topic: str, qos: Any) -> None:
        handle = {msg.PersonPoseArray: self._on_poses, msg.UwbRangeArray: self._on_round}
        handle[DiagnosticArray] = self._on_diagnostics
        interpret = handle.get(kind)

        def callback(data: bytes) -> None:
            received_ns = time.time_ns()
            self._bag.write(topic, kind, received_ns, data)
            self.watched.arrivals[topic].append(time.monotonic())
            if interpret:
                interpret(deserialize_message(data, kind), received_ns)

        self._node.create_subscription(kind, topic, callback, qos, raw=True)

    def _on_poses(self, array: msg.PersonPoseArray, received_ns: int) -> None:
        for person in array.people:
            position = person.pose.pose.position
            output = Output(
                received_ns,
                to_stamp_ns(person.stamp),
                position.x,
                position.y,
                tuple(person.pose.covariance[[0, 1, 7]]),
                person.horizontal_ce95,
                person.mode,
                person.los_fraction,
            )
            self.watched.outputs[person.person].append(output)

    def _on_round(self, array: msg.UwbRangeArray, received_ns: int) -> None:  # noqa: ARG002
        self.watched.rounds[array.tag_id] += 1

    def _on_diagnostics(self, array: DiagnosticArray, received_ns: int) -> None:  # noqa: ARG002
        self.watched.reports.update({status.name.split(":")[0] for status in array.status})


_TOPICS = [
    (msg.UwbRangeArray, "uwb/ranges", EVENTS),
    (msg.UwbPose, "uwb/pose", EVENTS),
    (msg.MeasurementVerdictArray, "uwb/verdicts", EVENTS),
    (msg.AnchorMap, "uwb/anchors", LATCHED),
    (msg.Step, "pdr/steps", EVENTS),
    (msg.Epoch, "sync/epochs", EVENTS),
    (msg.PersonPoseArray, "fused/poses", EVENTS),
    (msg.MeasurementVerdictArray, "fused/verdicts", EVENTS),
    (msg.FusionHealth, "fused/health", EVENTS),
    (TFMessage, "/tf", EVENTS),
    (DiagnosticArray, "/diagnostics", EVENTS),
]


def _person_topics(person: str) -> list[tuple[type, str, Any]]:
    return [
        (PoseWithCovarianceStamped, f"people/{person}/pose", EVENTS),
        (Imu, f"{person}/imu/data", STREAM),
        (MagneticField, f"{person}/imu/mag", STREAM),
        (Odometry, f"{person}/odometry", EVENTS),
    ]
