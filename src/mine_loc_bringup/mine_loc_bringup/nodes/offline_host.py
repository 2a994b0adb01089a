"""The replay's host of nodes: one thread, virtual time, messages handed over in memory in the order published."""

import sys
from collections import defaultdict, deque
from collections.abc import Callable, Iterable
from typing import Any, Protocol

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message

from mine_loc_bringup.graph import NodeProcess
from mine_loc_bringup.nodes.cdr import to_cdr
from mine_loc_bringup.parameter_files import read_parameters
from mine_loc_bringup.virtual_time import VirtualTime
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.nodes.diagnostics import PERIOD_S, to_diagnostic_array
from mine_loc_core.nodes.node_base import Callback, NodeBase
from mine_loc_core.parameters import from_mapping
from mine_loc_core.stamps import to_ns

_GATHER_NS = 200_000
_MOST_PENDING = 100_000


class Sink(Protocol):
    """Where everything goes that the nodes publish."""

    def write(self, topic: str, kind: type, stamp_ns: int, data: bytes) -> None:
        """Take one serialised message."""


class Letter:
    """A message on its way, as an object, as bytes, or made into the other when somebody asks for it."""

    def __init__(self, kind: type, message: Any = None, data: bytes | None = None) -> None:
        self.kind = kind
        self._message, self._data = message, data

    def message(self) -> Any:
        """The message."""
        if self._message is None:
            self._message = deserialize_message(self._data, self.kind)
        return self._message

    def data(self) -> bytes:
        """Its CDR bytes."""
        if self._data is None:
            self._data = to_cdr(self._message, self.kind)
        return self._data


class OfflineGraph:
    """Topics between the nodes of a replay."""

    def __init__(self, time: VirtualTime, sink: Sink) -> None:
        self.time = time
        self.subscriptions: dict[str, list[_Subscription]] = defaultdict(list)
        self.published: set[str] = set()
        self._latched: dict[str, Letter] = {}
        self._pending: deque[tuple[_Subscription, Letter]] = deque()
        self._delivering = False
        self._sink = sink

    def subscribe(self, subscription: "_Subscription") -> None:
        """Add a subscription; a latched message that was published before reaches it."""
        self.subscriptions[subscription.topic].append(subscription)
        if letter := self._latched.get(subscription.topic):
            self._deliver([(subscription, letter)])

    def publish(self, topic: str, letter: Letter, *, latched: bool = False) -> None:
        """Write down what a node says, and hand it to whoever listens."""
        self._sink.write(topic, letter.kind, self.time.ros_ns, letter.data())
        if latched:
            self._latched[topic] = letter
        self.hand_over(topic, letter)

    def hand_over(self, topic: str, letter: Letter) -> None:
        """To whoever listens; after what is under way, as if it were in the queue of another process."""
        self._deliver([(subscription, letter) for subscription in self.subscriptions.get(topic, ())])

    def _deliver(self, letters: Iterable[tuple["_Subscription", Letter]]) -> None:
        self._pending.extend(letters)
        if self._delivering:
            if len(self._pending) > _MOST_PENDING:
                raise RuntimeError(f"{len(self._pending)} messages are under way at one instant: a loop of topics")
            return
        self._delivering = True
        try:
            while self._pending:
                subscription, letter = self._pending.popleft()
                subscription.take(letter)
        finally:
            self._delivering = False


class _Subscription:
    def __init__(self, topic: str, kind: type, callback: Callback, *, raw: bool) -> None:
        self.topic, self.kind = topic, kind
        self._callback, self._raw = callback, raw

    def take(self, letter: Letter) -> None:
        self._callback(letter.data() if self._raw else letter.message())


class _Publisher:
    def __init__(self, graph: OfflineGraph, topic: str, kind: type, node: "OfflineHost", *, latched: bool) -> None:
        self._graph, self._topic, self._kind, self._host, self._latched = graph, topic, kind, node, latched
        graph.published.add(topic)

    def publish(self, message: Any) -> None:
        if self._host.node.active:
            letter = Letter(self._kind, message)
            self._graph.publish(self._topic, letter, latched=self._latched)

    def get_subscription_count(self) -> int:
        return 1  # the bag


class _Timer:
    def __init__(self, time: VirtualTime, period_ns: int, callback: Callback) -> None:
        self._time, self._period_ns, self._callback = time, period_ns, callback
        self.running = True
        self._due_ns = time.steady_ns
        self._next()

    def _next(self) -> None:
        self._due_ns += self._period_ns
        self._time.at(self._due_ns, self._happen)

    def _happen(self) -> None:
        if self.running:
            self._callback()
            self._next()


class _Alarm:
    def __init__(self, time: VirtualTime, callback: Callback) -> None:
        self._time, self._callback = time, callback
        self._due_ns: int | None = None

    def ring_at(self, ros_ns: int) -> None:
        due_ns = self._time.steady_ns + max(ros_ns - self._time.ros_ns, 0)
        if self._due_ns is None or due_ns < self._due_ns:
            self._due_ns = due_ns
            self._time.at(due_ns, lambda: self._ring(due_ns))

    def cancel(self) -> None:
        self._due_ns = None

    def _ring(self, due_ns: int) -> None:
        if due_ns == self._due_ns:
            self._due_ns = None
            self._callback()


class _Worker:
    """Works as late after it was woken as the live graph's thread does, and takes no time."""

    def __init__(self, time: VirtualTime, work: Callback) -> None:
        self._time, self._work = time, work
        self._woken = self._ended = False

    def wake(self) -> None:
        if not self._woken:
            self._woken = True
            self._time.at(self._time.steady_ns + _GATHER_NS, self._happen)

    def end(self) -> None:
        self._ended = True

    def _happen(self) -> None:
        self._woken = False
        if not self._ended:
            self._work()


class OfflineHost:
    """Carries one node of the replay."""

    def __init__(self, node_class: type[NodeBase], process: NodeProcess, graph: OfflineGraph) -> None:
        self._process, self._graph = process, graph
        self._last_error = ""
        self._told: set[str] = set()
        self.node = node_class(self)
        self._diagnostics = _Publisher(graph, "/diagnostics", DiagnosticArray, self, latched=False)
        self.make_timer(PERIOD_S, self._publish_diagnostics)

    @property
    def node_name(self) -> str:
        """Name of the node in its graph."""
        return self._process.node_name

    def declare(self, parameter_class: type) -> Any:
        """Parameters from the site's files and from the graph, as the live graph has them."""
        file = self._process.parameter_file
        values = read_parameters(file, f"/{self._process.name}") if file else {}
        given = {name: value for name, value in self._process.parameters.items() if name != "use_sim_time"}
        return from_mapping(parameter_class, values | given, self.node_name)

    def now_ns(self) -> int:
        """The bag's time."""
        return self._graph.time.ros_ns

    def steady_ns(self) -> int:
        """Time that never jumps. Nothing that a node does takes any."""
        return self._graph.time.steady_ns

    def make_publisher(self, kind: type, topic: str, qos: QoSProfile, *, active: bool) -> _Publisher:  # noqa: ARG002
        """A publisher into the graph and the bag."""
        latched = qos.durability is DurabilityPolicy.TRANSIENT_LOCAL
        return _Publisher(self._graph, self._resolve(topic), kind, self, latched=latched)

    def make_subscription(
        self,
        kind: type,
        topic: str,
        callback: Callback,
        qos: QoSProfile,  # noqa: ARG002
        *,
        raw: bool,
    ) -> _Subscription:
        """A subscription; nothing is lost on the way."""
        subscription = _Subscription(self._resolve(topic), kind, callback, raw=raw)
        self._graph.subscribe(subscription)
        return subscription

    def make_timer(self, period_s: float, callback: Callback) -> _Timer:
        """A timer of virtual time."""
        return _Timer(self._graph.time, to_ns(period_s), callback)

    def make_alarm(self, callback: Callback) -> _Alarm:
        """An alarm of the bag's time."""
        return _Alarm(self._graph.time, callback)

    def make_service(self, kind: type, name: str, callback: Callable[[Any, Any], Any]) -> object:  # noqa: ARG002
        """Nobody calls a service in a replay."""
        return object()

    def make_worker(self, prepare: Callback, work: Callback) -> _Worker:
        """Prepares now."""
        prepare()
        return _Worker(self._graph.time, work)

    def discard(self, entity: Any) -> None:
        """End a subscription, timer or alarm."""
        if isinstance(entity, _Subscription):
            self._graph.subscriptions[entity.topic].remove(entity)
        elif isinstance(entity, _Timer):
            entity.running = False
        elif isinstance(entity, _Alarm):
            entity.cancel()

    def info(self, text: str) -> None:
        """To stderr."""
        self.warn(text)

    def warn(self, text: str) -> None:
        """To stderr."""
        print(f"[{self.node_name}] {text}", file=sys.stderr)

    def error(self, text: str, *, repeated: bool = False) -> None:  # noqa: ARG002
        """To stderr, once a text."""
        self._last_error = text
        if text not in self._told:
            self._told.add(text)
            self.warn(text)

    def configure(self) -> None:
        """First half of its start. Raises ConfigurationError with the node's own words."""
        self._must(self.node.enter_inactive())

    def activate(self) -> None:
        """Second half of its start. Raises ConfigurationError with the node's own words."""
        self._must(self.node.enter_active())

    def _must(self, success: bool) -> None:  # noqa: FBT001
        if not success:
            raise ConfigurationError(f"{self.node_name}: {self._last_error}")

    def _publish_diagnostics(self) -> None:
        full_name = f"/{self._process.name}"
        self._diagnostics.publish(to_diagnostic_array(full_name, self.node.statuses(), self.now_ns()))

    def _resolve(self, topic: str) -> str:
        if topic.startswith("/"):
            return topic
        if topic.startswith("~/"):
            return f"/{self._process.name}/{topic[2:]}"
        return f"{self._process.namespace.rstrip('/')}/{topic}"
