"""What all our nodes derive from: declare, convert, call, publish; never die, say how it is.

A node is carried by a host: `RosHost` in the live graph, the offline replay's in a replay. So the same node code runs
in both.
"""

import importlib
import inspect
from collections.abc import Callable, Iterable
from dataclasses import asdict
from typing import Any, ClassVar, Protocol

from rclpy.qos import QoSProfile

from mine_loc_core.errors import MineLocError
from mine_loc_core.health import Health, Level
from mine_loc_core.parameters import from_mapping

Callback = Callable[..., None]


class Worker(Protocol):
    """A thread of a node's own, or what stands for it."""

    def wake(self) -> None:
        """There is work."""

    def end(self) -> None:
        """There will be no more."""


class Alarm(Protocol):
    """Rings once, at a ROS time."""

    def ring_at(self, ros_ns: int) -> None:
        """Ring then, or earlier where it is set earlier already."""

    def cancel(self) -> None:
        """Do not ring."""


class Host(Protocol):
    """What a node runs in. Entities that it makes are given back to `discard`."""

    @property
    def node_name(self) -> str:
        """Name of the node in its graph."""

    def declare(self, parameter_class: type) -> Any:
        """The node's parameters. Raises ConfigurationError for a value that is not allowed."""

    def now_ns(self) -> int:
        """ROS time."""

    def steady_ns(self) -> int:
        """Time that never jumps, of no particular origin."""

    def make_publisher(self, kind: type, topic: str, qos: QoSProfile, *, active: bool) -> Any:
        """A publisher that is silent while the node is inactive, with `publish` and `get_subscription_count`."""

    def make_subscription(self, kind: type, topic: str, callback: Callback, qos: QoSProfile, *, raw: bool) -> Any:
        """A subscription; `raw` hands over serialised bytes."""

    def make_timer(self, period_s: float, callback: Callback) -> Any:
        """A timer of steady time."""

    def make_alarm(self, callback: Callback) -> Alarm:
        """An alarm of ROS time, not set."""

    def make_service(self, kind: type, name: str, callback: Callable[[Any, Any], Any]) -> Any:
        """A service; the callback is given a request and a response to fill."""

    def make_worker(self, prepare: Callback, work: Callback) -> Worker:
        """Begins to prepare at once, and then works after each time that it was woken, once for several."""

    def discard(self, entity: Any) -> None:
        """Destroy what one of the methods above made."""

    def info(self, text: str) -> None:
        """Into the log."""

    def warn(self, text: str) -> None:
        """Into the log."""

    def error(self, text: str, *, repeated: bool = False) -> None:
        """Into the log; what may come `repeated` is told once a second."""


def node_class(module_name: str) -> "type[NodeBase]":
    """The class of the node that a module is. Raises ImportError where there is no such module."""
    module = importlib.import_module(module_name)
    kinds = (kind for kind in vars(module).values() if inspect.isclass(kind) and kind.__module__ == module_name)
    return next(kind for kind in kinds if issubclass(kind, NodeBase))


class NodeBase:
    """A node with validated parameters, health for the diagnostics, and notice of jumps of the clock.

    A subclass names itself and its parameter dataclass, overrides `configure` (create publishers, subscriptions,
    services with the methods here), and as needed `activate`, `deactivate`, `parameters_changed`, `clock_jumped` and
    `health`. An exception in a callback is logged, counted and reported; it never stops the node.
    """

    default_name: ClassVar[str]
    parameter_class: ClassVar[type]

    def __init__(self, host: Host) -> None:
        self.host = host
        self.active = False
        self.parameters = host.declare(self.parameter_class)
        self._made: dict[Any, None] = {}  # what `configure` created, in order
        self.faults: dict[str, int] = {}
        """Exceptions in callbacks, by where."""
        self._last_fault = ""

    # What a subclass overrides.

    def configure(self) -> None:
        """Create publishers, subscriptions, services. Raise MineLocError where the configuration is impossible."""

    def activate(self) -> None:
        """Begin work."""

    def deactivate(self) -> None:
        """Stop work and release what `activate` took."""

    def parameters_changed(self) -> None:
        """`self.parameters` has new values."""

    def clock_jumped(self, delta_ns: int) -> None:
        """ROS time jumped by `delta_ns`: forget what rests on stamps."""

    def health(self) -> Iterable[Health]:
        """Components and how they are."""
        return ()

    # What a subclass uses.

    @property
    def name(self) -> str:
        """Name of the node in its graph."""
        return self.host.node_name

    def now_ns(self) -> int:
        """ROS time in nanoseconds."""
        return self.host.now_ns()

    def steady_ns(self) -> int:
        """Nanoseconds that never jump, to measure how long ago something was."""
        return self.host.steady_ns()

    def publish_to(self, kind: type, topic: str, qos: QoSProfile) -> Any:
        """A publisher that is silent while the node is inactive."""
        return self._keep(self.host.make_publisher(kind, topic, qos, active=self.active))

    def subscribe(
        self, kind: type, topic: str, callback: Callable[[Any], None], qos: QoSProfile, *, raw: bool = False
    ) -> Any:
        """A subscription that is heard while the node is active; `raw` hands over serialised bytes, no message."""
        return self._keep(self.host.make_subscription(kind, topic, self.guarded(callback, topic), qos, raw=raw))

    def every(self, period_s: float, callback: Callable[[], None]) -> Any:
        """A timer of steady time that runs while the node is active."""
        return self._keep(self.host.make_timer(period_s, self.guarded(callback, callback.__name__)))

    def alarm(self, callback: Callable[[], None]) -> Alarm:
        """An alarm of ROS time that is heard while the node is active. Where time jumps, cancel it."""
        alarm: Alarm = self._keep(self.host.make_alarm(self.guarded(callback, callback.__name__)))
        return alarm

    def serve(self, kind: type, name: str, answer: Callable[[Any], tuple[bool, str]]) -> Any:
        """A service whose response carries `success` and `reason`."""

        def callback(request: Any, response: Any) -> Any:
            try:
                response.success, response.reason = answer(request)
            except MineLocError as error:
                response.success, response.reason = False, str(error)
            except Exception as error:  # noqa: BLE001 a service must answer
                self._fault(name, error)
                response.success, response.reason = False, repr(error)
            return response

        return self._keep(self.host.make_service(kind, name, callback))

    def release(self, *entities: Any) -> None:
        """Destroy publishers, subscriptions, timers or services that the methods above made."""
        for entity in entities:
            del self._made[entity]
            self.host.discard(entity)

    def _keep(self, entity: Any) -> Any:
        self._made[entity] = None
        return entity

    def guarded(self, callback: Callback, name: str) -> Callback:
        """The callback, silent while inactive, its exceptions reported instead of raised."""

        def call(*arguments: Any) -> None:
            if not self.active:
                return
            try:
                callback(*arguments)
            except Exception as error:  # noqa: BLE001 one bad message must not stop a node lives hang on
                self._fault(name, error)

        return call

    # What the host uses.

    def enter_inactive(self) -> bool:
        """Transition: `configure`; what it created is released if it fails."""
        if self._succeeds(self.configure):
            return True
        self.clean_up()
        return False

    def enter_active(self) -> bool:
        """Transition: `activate`."""
        self.active = True
        self.active = self._succeeds(self.activate)
        return self.active

    def leave_active(self) -> None:
        """Transition: `deactivate`."""
        if self.active:
            self.active = False
            self._succeeds(self.deactivate)

    def clean_up(self) -> None:
        """Transition: release what `configure` created, which will create it anew."""
        self.release(*self._made)

    def change_parameters(self, changes: dict[str, Any]) -> None:
        """Take new values of parameters. Raises ConfigurationError and keeps the old ones where one is not allowed."""
        self.parameters = from_mapping(self.parameter_class, asdict(self.parameters) | changes, self.name)
        if changes and self.active:
            self.parameters_changed()

    def announce_jump(self, delta_ns: int) -> None:
        """ROS time jumped."""
        self.host.warn(f"time jumped by {delta_ns / 1e9:+.3f} s")
        self.guarded(self.clock_jumped, "clock_jumped")(delta_ns)

    def statuses(self) -> list[Health]:
        """Everything for the diagnostics."""
        found = [*self.health()] if self.active else []
        if self.faults:
            found.append(Health("callbacks", Level.ERROR, self._last_fault, self.faults))
        else:
            found.append(Health("callbacks", Level.OK, "running" if self.active else "inactive"))
        return found

    def _succeeds(self, step: Callable[[], None]) -> bool:
        try:
            step()
        except MineLocError as error:
            self.host.error(str(error))
        except Exception as error:  # noqa: BLE001 a transition's exception would vanish without a word
            self._fault(step.__name__, error)
        else:
            return True
        return False

    def _fault(self, where: str, error: Exception) -> None:
        self.faults[where] = self.faults.get(where, 0) + 1
        self._last_fault = f"{where}: {error!r}"
        self.host.error(self._last_fault, repeated=True)
