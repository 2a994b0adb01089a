"""What another program sees of the graph: topics collected, services called, events waited for with a deadline."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from graph.processes import Running
from rclpy.context import Context
from rclpy.experimental import EventsExecutor
from rclpy.node import Node

from mine_loc_core.nodes.qos import EVENTS

DEADLINE_S = 20.0


@dataclass
class Heard:
    """Messages of one topic and when each came (time.monotonic)."""

    messages: list[Any] = field(default_factory=list, repr=False)
    at_s: list[float] = field(default_factory=list, repr=False)

    def __len__(self) -> int:
        return len(self.messages)

    def since(self, instant_s: float) -> list[Any]:
        """Messages that came after an instant."""
        return [message for message, at_s in zip(self.messages, self.at_s, strict=True) if at_s > instant_s]


class Observer:
    """A node in the test's own process. Nothing is heard but inside `wait_for`, `watch` and `call`."""

    def __init__(self, domain: int) -> None:
        self._context = Context()
        self._context.init(domain_id=domain)
        self.node = Node("observer", context=self._context)
        self._executor = EventsExecutor(context=self._context)
        self._executor.add_node(self.node)
        self.status: dict[str, DiagnosticStatus] = {}
        self._clients: dict[str, Any] = {}
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, 100)

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    def listen(self, kind: type, topic: str, qos: Any = EVENTS) -> Heard:
        heard = Heard()

        def callback(message: Any) -> None:
            heard.messages.append(message)
            heard.at_s.append(time.monotonic())

        self.node.create_subscription(kind, topic, callback, qos)
        return heard

    def wait_for(self, happened: Callable[[], Any], deadline_s: float = DEADLINE_S, what: str = "") -> float:
        """Listen until it happened; the seconds it took. Fails after the deadline."""
        started_s = time.monotonic()
        while not happened():
            waited_s = time.monotonic() - started_s
            assert waited_s < deadline_s, f"not within {deadline_s} s: {what or happened}; {self.summary()}"
            self._executor.spin_once(timeout_sec=0.02)
        return time.monotonic() - started_s

    def wait_while_alive(self, run: Running, happened: Callable[[], Any], what: str) -> None:
        """As `wait_for`; fails at once, with what it wrote, when the process ends."""
        self.wait_for(lambda: happened() or not run.alive, what=what)
        assert run.alive, run.output

    def call(self, kind: type, name: str, request: Any) -> Any:
        client = self._clients.get(name) or self.node.create_client(kind, name)
        self._clients[name] = client
        self.wait_for(client.service_is_ready, what=f"service {name}")
        future = client.call_async(request)
        self.wait_for(future.done, what=f"answer of {name}")
        return future.result()

    def level(self, name: str) -> int | None:
        """Level last said of a component ("node: component")."""
        status = self.status.get(name)
        return None if status is None else status.level[0]

    def value(self, name: str, key: str) -> int:
        """A counter of a component, 0 where it is not mentioned."""
        status = self.status.get(name)
        return next((int(item.value) for item in status.values if item.key == key), 0) if status else 0

    def summary(self) -> str:
        return "; ".join(f"{name} {status.level[0]} {status.message}" for name, status in sorted(self.status.items()))

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        self.status |= {status.name: status for status in array.status}
