"""The live graph's host of a node: an rclpy lifecycle node that starts itself and tells its health once a second."""

import contextlib
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy._rclpy_pybind11 import RCLError
from rclpy.clock import Clock, ClockType, JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.experimental import EventsExecutor
from rclpy.lifecycle import LifecycleNode, LifecyclePublisher, LifecycleState, TransitionCallbackReturn
from rclpy.logging import get_logger
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.service import Service
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from mine_loc_core.errors import ConfigurationError, MineLocError
from mine_loc_core.nodes.diagnostics import PERIOD_S, to_diagnostic_array
from mine_loc_core.nodes.node_base import Callback, NodeBase
from mine_loc_core.parameters import Constraint, constraints, from_mapping

_WATCH_PERIOD_S = 0.2
_JUMP_NS = 500_000_000
_SPIN_S = 0.2
_NEVER_S = 3600.0  # a timer needs a period


class RosHost(LifecycleNode):
    """Carries one node. What is ROS of a node is here, what is the node's own is in NodeBase."""

    def __init__(self, node_class: type[NodeBase], arguments: list[str] | None = None) -> None:
        """`arguments` are ROS arguments of this node alone; without, those of the process hold."""
        super().__init__(node_class.default_name, cli_args=arguments, use_global_arguments=arguments is None)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.node = node_class(self)
        self.add_on_set_parameters_callback(self._on_set_parameters)
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._jump_handle = self.get_clock().create_jump_callback(
            JumpThreshold(min_forward=Duration(nanoseconds=_JUMP_NS), min_backward=Duration(nanoseconds=-1)),
            post_callback=self._on_ros_time_jump,
        )
        self._system_minus_steady_ns = time.time_ns() - time.monotonic_ns()
        self.make_timer(_WATCH_PERIOD_S, self._watch_system_clock)
        self.make_timer(PERIOD_S, self._publish_diagnostics)

    # What a node asks of its host.

    @property
    def node_name(self) -> str:
        """Name of the node in its graph."""
        return str(self.get_name())

    def declare(self, parameter_class: type) -> Any:
        """The node's parameters, declared with their descriptors."""
        values = {}
        for name, (_, default, constraint) in constraints(parameter_class).items():
            try:
                values[name] = self.declare_parameter(name, default, _descriptor(constraint, default)).value
            except (InvalidParameterValueException, InvalidParameterTypeException) as error:
                reason = str(error).splitlines()[0]
                raise ConfigurationError(
                    f"{self.get_name()}: {name}: {reason}; allowed: {constraint.allowed()}"
                ) from error
        return from_mapping(parameter_class, values, self.node_name)

    def now_ns(self) -> int:
        """ROS time."""
        return int(self.get_clock().now().nanoseconds)

    def steady_ns(self) -> int:
        """Steady time of the machine."""
        return time.monotonic_ns()

    def make_publisher(self, kind: type, topic: str, qos: QoSProfile, *, active: bool) -> Any:
        """A lifecycle publisher."""
        publisher = self.create_lifecycle_publisher(kind, topic, qos)
        if active:  # it missed the transition
            publisher.on_activate(None)
        return publisher

    def make_subscription(self, kind: type, topic: str, callback: Callback, qos: QoSProfile, *, raw: bool) -> Any:
        """A subscription of rclpy."""
        return self.create_subscription(kind, topic, callback, qos, raw=raw)

    def make_timer(self, period_s: float, callback: Callback) -> Any:
        """A timer of rclpy on steady time."""
        return self.create_timer(period_s, callback, clock=self._steady)

    def make_alarm(self, callback: Callback) -> "_Alarm":
        """A timer of rclpy on ROS time that is cancelled as soon as it has fired."""
        return _Alarm(self, callback)

    def make_service(self, kind: type, name: str, callback: Callable[[Any, Any], Any]) -> Any:
        """A service of rclpy."""
        return self.create_service(kind, name, callback)

    def make_worker(self, prepare: Callback, work: Callback) -> "_WorkerThread":
        """A thread."""
        worker = _WorkerThread(prepare, work)
        worker.start()
        return worker

    def discard(self, entity: Any) -> None:
        """Destroy a publisher, subscription, timer, alarm or service."""
        destroy: dict[type, Callable[[Any], Any]] = {
            LifecyclePublisher: self.destroy_lifecycle_publisher,
            Subscription: self.destroy_subscription,
            Timer: self.destroy_timer,
            _Alarm: lambda alarm: self.destroy_timer(alarm.timer),
            Service: self.destroy_service,
        }
        destroy[type(entity)](entity)

    def info(self, text: str) -> None:
        """Into the log."""
        self.get_logger().info(text)

    def warn(self, text: str) -> None:
        """Into the log."""
        self.get_logger().warning(text)

    def error(self, text: str, *, repeated: bool = False) -> None:
        """Into the log."""
        if repeated:
            self.get_logger().error(text, throttle_duration_sec=1.0)
        else:
            self.get_logger().error(text)

    # Lifecycle.

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Lifecycle transition."""
        return super().on_configure(state) if self.node.enter_inactive() else TransitionCallbackReturn.FAILURE

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Lifecycle transition."""
        result = super().on_activate(state)
        return result if self.node.enter_active() else TransitionCallbackReturn.FAILURE

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Lifecycle transition."""
        self.node.leave_active()
        return super().on_deactivate(state)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Lifecycle transition."""
        self.node.clean_up()
        return super().on_cleanup(state)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Lifecycle transition."""
        if self.node.active:
            self.on_deactivate(state)
        return TransitionCallbackReturn.SUCCESS

    def start(self) -> bool:
        """Configure and activate without a lifecycle manager; the log says why where it fails."""
        success = TransitionCallbackReturn.SUCCESS
        return self.trigger_configure() == success and self.trigger_activate() == success

    # Parameters, time, diagnostics.

    def _on_set_parameters(self, changes: list[Parameter]) -> SetParametersResult:
        known = constraints(self.node.parameter_class)
        try:
            self.node.change_parameters({each.name: each.value for each in changes if each.name in known})
        except MineLocError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _on_ros_time_jump(self, jump: TimeJump) -> None:
        delta = jump.delta
        self.node.announce_jump(delta if isinstance(delta, int) else delta.nanoseconds)

    def _watch_system_clock(self) -> None:
        difference_ns = time.time_ns() - time.monotonic_ns()
        delta_ns = difference_ns - self._system_minus_steady_ns
        self._system_minus_steady_ns = difference_ns
        if abs(delta_ns) > _JUMP_NS and not self.get_clock().ros_time_is_active:
            self.node.announce_jump(delta_ns)

    def _publish_diagnostics(self) -> None:
        name = self.get_fully_qualified_name()
        self._diagnostics.publish(to_diagnostic_array(name, self.node.statuses(), self.now_ns()))


class _Alarm:
    def __init__(self, host: RosHost, callback: Callback) -> None:
        self._now_ns, self._callback = host.now_ns, callback
        self._due_ns: int | None = None
        self.timer = host.create_timer(_NEVER_S, self._ring, clock=host.get_clock(), autostart=False)

    def ring_at(self, ros_ns: int) -> None:
        if self._due_ns is None or ros_ns < self._due_ns:
            self._due_ns = ros_ns
            self.timer.timer_period_ns = max(ros_ns - self._now_ns(), 1)
            self.timer.reset()

    def cancel(self) -> None:
        if self._due_ns is not None:
            self._due_ns = None
            self.timer.cancel()

    def _ring(self) -> None:
        self.cancel()
        self._callback()


class _WorkerThread(threading.Thread):
    """Prepares, and then works whenever it was woken, until it is ended."""

    def __init__(self, prepare: Callback, work: Callback) -> None:
        super().__init__(daemon=True)
        self._prepare, self._work = prepare, work
        self._woken = threading.Event()
        self._ended = False

    def run(self) -> None:
        """Of the thread."""
        self._prepare()
        while True:
            self._woken.wait()
            if self._ended:
                return
            self._woken.clear()
            self._work()

    def wake(self) -> None:
        """There is work."""
        self._woken.set()

    def end(self) -> None:
        """There will be no more."""
        self._ended = True
        self._woken.set()


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


def run(node_class: type[NodeBase], on_made: Callable[[Any], None] = lambda _: None) -> int:
    """Run a node until SIGINT or SIGTERM. Exit status 2 when its configuration is impossible.

    `on_made` gets the node before it starts, for a caller who asks it something afterwards.

    Without a lifecycle manager the node configures and activates itself (parameter `autostart`).
    """
    host = None
    with ros(sys.argv) as stopping:
        try:
            host = RosHost(node_class)
            on_made(host.node)
            if host.node.parameters.autostart and not host.start():
                return 2  # the transition has logged why
            executor = EventsExecutor()
            executor.add_node(host)
            while not stopping.is_set():
                spin_some(executor)
        except ConfigurationError as error:
            print(error, file=sys.stderr)
            return 2
        finally:
            if host is not None:
                host.node.leave_active()
    return 0


@contextlib.contextmanager
def ros(arguments: list[str]) -> Iterator[threading.Event]:
    """ROS in this process, and an event that SIGINT and SIGTERM set."""
    stopping = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stopping.set())
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    try:
        yield stopping
    finally:
        rclpy.try_shutdown()


def spin_some(executor: EventsExecutor) -> None:
    """Let nodes work for a while. Not spin(): the events executor's burns a core and never returns (rclpy 7.1.6)."""
    try:
        executor.spin_once(timeout_sec=_SPIN_S)
    except RCLError as error:  # rclpy raises it for an impossible change_state request (ros2/rclpy#1209)
        get_logger("executor").error(str(error))
