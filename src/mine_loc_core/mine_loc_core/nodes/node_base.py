"""The lifecycle node all of ours derive from: declare, convert, call, publish; never die, say how it is."""

import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict
from typing import Any, ClassVar

import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType, JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions

from mine_loc_core.errors import ConfigurationError, MineLocError
from mine_loc_core.health import Health, Level
from mine_loc_core.parameters import Constraint, constraints, from_mapping

_WATCH_PERIOD_S = 0.2
_DIAGNOSTICS_PERIOD_S = 1.0
_JUMP_NS = 500_000_000
_SPIN_S = 0.2


class NodeBase(LifecycleNode):
    """A lifecycle node with validated parameters, diagnostics at 1 Hz and clock-jump notice.

    A subclass names its parameter dataclass, overrides `configure` (create publishers, subscriptions, services with
    the methods here), and as needed `activate`, `deactivate`, `parameters_changed`, `clock_jumped` and `health`.
    An exception in a callback is logged, counted and reported; it never stops the node.
    """

    parameter_class: ClassVar[type]
    needs_guard_condition: ClassVar[bool] = False  # only the single-threaded executor has them

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self.active = False
        self.parameters = self._declare_parameters()
        self.add_on_set_parameters_callback(self._on_set_parameters)
        self._made: dict[Any, Callable[[Any], Any]] = {}  # what `configure` created, and how to destroy it
        self._faults: dict[str, int] = {}
        self._last_fault = ""
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._jump_handle = self.get_clock().create_jump_callback(
            JumpThreshold(min_forward=Duration(nanoseconds=_JUMP_NS), min_backward=Duration(nanoseconds=-1)),
            post_callback=self._on_ros_time_jump,
        )
        self._system_minus_steady_ns = time.time_ns() - time.monotonic_ns()
        self.create_timer(_WATCH_PERIOD_S, self._watch_system_clock, clock=self._steady)
        self.create_timer(_DIAGNOSTICS_PERIOD_S, self._publish_diagnostics, clock=self._steady)

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

    def now_ns(self) -> int:
        """ROS time in nanoseconds."""
        return self.get_clock().now().nanoseconds

    def publish_to(self, kind: type, topic: str, qos: QoSProfile) -> Any:
        """A publisher that is silent while the node is inactive."""
        publisher = self.create_lifecycle_publisher(kind, topic, qos)
        if self.active:  # it missed the transition
            publisher.on_activate(None)
        return self._keep(publisher, self.destroy_lifecycle_publisher)

    def subscribe(
        self, kind: type, topic: str, callback: Callable[[Any], None], qos: QoSProfile, *, raw: bool = False
    ) -> Any:
        """A subscription that is heard while the node is active; `raw` hands over serialised bytes, no message."""
        subscription = self.create_subscription(kind, topic, self.guarded(callback, topic), qos, raw=raw)
        return self._keep(subscription, self.destroy_subscription)

    def every(self, period_s: float, callback: Callable[[], None]) -> Any:
        """A timer of steady time that runs while the node is active."""
        timer = self.create_timer(period_s, self.guarded(callback, callback.__name__), clock=self._steady)
        return self._keep(timer, self.destroy_timer)

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

        return self._keep(self.create_service(kind, name, callback), self.destroy_service)

    def release(self, *entities: Any) -> None:
        """Destroy publishers, subscriptions, timers or services that the methods above made."""
        for entity in entities:
            self._made.pop(entity)(entity)

    def _keep(self, entity: Any, destroy: Callable[[Any], Any]) -> Any:
        self._made[entity] = destroy
        return entity

    def guarded(self, callback: Callable[..., None], name: str) -> Callable[..., None]:
        """The callback, silent while inactive, its exceptions reported instead of raised."""

        def call(*arguments: Any) -> None:
            if not self.active:
                return
            try:
                callback(*arguments)
            except Exception as error:  # noqa: BLE001 one bad message must not stop a node lives hang on
                self._fault(name, error)

        return call

    # Lifecycle: rclpy swallows what a transition raises, so each says why it failed.

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Lifecycle transition: `configure`."""
        if not self._transition(self.configure):
            self.release(*self._made)
            return TransitionCallbackReturn.FAILURE
        return super().on_configure(state)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Lifecycle transition: `activate`."""
        result = super().on_activate(state)
        self.active = True
        if self._transition(self.activate):
            return result
        self.active = False
        return TransitionCallbackReturn.FAILURE

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Lifecycle transition: `deactivate`."""
        self.active = False
        self._transition(self.deactivate)
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Lifecycle transition: release what `configure` created, which will create it anew."""
        self.release(*self._made)
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Lifecycle transition: deactivate if need be."""
        if self.active:
            self.on_deactivate(state)
        return TransitionCallbackReturn.SUCCESS

    def _transition(self, step: Callable[[], None]) -> bool:
        try:
            step()
        except MineLocError as error:
            self.get_logger().error(str(error))
        except Exception as error:  # noqa: BLE001 see above
            self._fault(step.__name__, error)
        else:
            return True
        return False

    # Parameters.

    def _declare_parameters(self) -> Any:
        values = {}
        for name, (_, default, constraint) in constraints(self.parameter_class).items():
            try:
                values[name] = self.declare_parameter(name, default, _descriptor(constraint, default)).value
            except (InvalidParameterValueException, InvalidParameterTypeException) as error:
                reason = str(error).splitlines()[0]
                raise ConfigurationError(
                    f"{self.get_name()}: {name}: {reason}; allowed: {constraint.allowed()}"
                ) from error
        return from_mapping(self.parameter_class, values, self.get_name())

    def _on_set_parameters(self, changes: list[Parameter]) -> SetParametersResult:
        known = constraints(self.parameter_class)
        ours = {change.name: change.value for change in changes if change.name in known}
        try:
            self.parameters = from_mapping(self.parameter_class, asdict(self.parameters) | ours, self.get_name())
            if ours and self.active:
                self.parameters_changed()
        except MineLocError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    # Time.

    def _on_ros_time_jump(self, jump: TimeJump) -> None:
        delta = jump.delta
        self._announce_jump(delta if isinstance(delta, int) else delta.nanoseconds)

    def _watch_system_clock(self) -> None:
        difference_ns = time.time_ns() - time.monotonic_ns()
        delta_ns = difference_ns - self._system_minus_steady_ns
        self._system_minus_steady_ns = difference_ns
        if abs(delta_ns) > _JUMP_NS and not self.get_clock().ros_time_is_active:
            self._announce_jump(delta_ns)

    def _announce_jump(self, delta_ns: int) -> None:
        self.get_logger().warning(f"time jumped by {delta_ns / 1e9:+.3f} s")
        self.guarded(self.clock_jumped, "clock_jumped")(delta_ns)

    # Diagnostics.

    def _fault(self, where: str, error: Exception) -> None:
        self._faults[where] = self._faults.get(where, 0) + 1
        self._last_fault = f"{where}: {error!r}"
        self.get_logger().error(f"{where}: {error!r}", throttle_duration_sec=1.0)

    def _publish_diagnostics(self) -> None:
        statuses = [*self.health()] if self.active else []
        if self._faults:
            statuses.append(Health("callbacks", Level.ERROR, self._last_fault, self._faults))
        else:
            statuses.append(Health("callbacks", Level.OK, "running" if self.active else "inactive"))
        array = DiagnosticArray(status=[_status(self.get_fully_qualified_name(), health) for health in statuses])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)


def _descriptor(constraint: Constraint, default: Any) -> ParameterDescriptor:
    unit = f" [{constraint.unit}]" if constraint.unit else ""
    descriptor = ParameterDescriptor(
        description=constraint.description + unit,
        additional_constraints="" if not constraint.choices else constraint.allowed(),
        read_only=constraint.read_only,
    )
    bounded = constraint.low is not None or constraint.high is not None
    low = float("-inf") if constraint.low is None else constraint.low
    high = float("inf") if constraint.high is None else constraint.high
    if bounded and isinstance(default, float):
        descriptor.floating_point_range = [FloatingPointRange(from_value=float(low), to_value=float(high))]
    elif bounded and isinstance(default, int) and not isinstance(default, bool):
        last = 2**63 - 1
        descriptor.integer_range = [
            IntegerRange(
                from_value=max(-last, int(low)) if low > -last else -last, to_value=int(high) if high < last else last
            )
        ]
    return descriptor


def _status(node: str, health: Health) -> DiagnosticStatus:
    return DiagnosticStatus(
        level=bytes([health.level]),
        name=f"{node.lstrip('/')}: {health.component}",
        message=health.message,
        hardware_id=health.hardware_id,
        values=[KeyValue(key=str(key), value=str(value)) for key, value in health.values.items()],
    )


def run(node_class: Callable[[], NodeBase]) -> int:
    """Run a node until SIGINT or SIGTERM. Exit status 2 when its configuration is impossible.

    Without a lifecycle manager the node configures and activates itself (parameter `autostart`).
    """
    stopping = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopping.set())
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    node = None
    try:
        node = node_class()
        if node.parameters.autostart and not _start(node):
            return 2  # the transition has logged why
        executor = SingleThreadedExecutor() if node.needs_guard_condition else EventsExecutor()
        executor.add_node(node)
        while not stopping.is_set():  # not spin(): the events executor's burns a core and never returns (rclpy 7.1.6)
            try:
                executor.spin_once(timeout_sec=_SPIN_S)
            except RCLError as error:  # rclpy raises it for an impossible change_state request (ros2/rclpy#1209)
                node.get_logger().error(str(error))
    except ConfigurationError as error:
        print(error, file=sys.stderr)
        return 2
    finally:
        if node is not None:
            if node.active:
                node.deactivate()
            node.active = False
        rclpy.try_shutdown()
    return 0


def _start(node: NodeBase) -> bool:
    success = TransitionCallbackReturn.SUCCESS
    return node.trigger_configure() == success and node.trigger_activate() == success
