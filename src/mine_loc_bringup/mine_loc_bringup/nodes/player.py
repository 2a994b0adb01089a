"""Plays a bag with /clock: serialised messages as they were recorded, with the quality of service they had."""

import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rclpy.qos import DurabilityPolicy, QoSProfile
from rosbags.interfaces import Connection
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

from mine_loc_bringup.bags.bag_reader import BagReader
from mine_loc_bringup.bags.graph_topics import played_by_default
from mine_loc_bringup.bags.message_definitions import MessageDefinitions, type_hash
from mine_loc_bringup.bags.patterns import TopicPatterns, split_list, unmatched
from mine_loc_bringup.bags.timeline import Timeline
from mine_loc_bringup.message_types import message_class
from mine_loc_bringup.nodes.bag_qos import to_publish
from mine_loc_bringup.parameters import PlayerParameters
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.node_base import NodeBase
from mine_loc_core.nodes.ros_host import RosHost, run
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S

_TICK_NS = 10 * NS_PER_MS
_SETTLE_S = 0.1  # at each beginning: nodes see the clock jump before they hear what came after
_MATCH_S, _LONGEST_MATCH_S = 1.0, 4.0  # subscribers are complete when none came for so long after others
_MOST_BEHIND_NS = 20 * NS_PER_MS  # in steady time; beyond it the clock waits
_CLOCK_QOS = QoSProfile(depth=10)


class Player(NodeBase):
    """Publishes from activation on, in a thread of its own; the process ends with the bag unless it loops."""

    default_name = "player"
    parameter_class = PlayerParameters
    parameters: PlayerParameters
    host: RosHost

    def __init__(self, host: RosHost) -> None:
        super().__init__(host)
        self.problem = ""
        """Why the bag could not be played to its end."""

    def configure(self) -> None:
        """Open the bag and offer its topics."""
        parameters = self.parameters
        self._bag = BagReader(Path(parameters.bag))
        self._first_ns = self._bag.start_ns + round(parameters.start_offset_s * NS_PER_S)
        if self._first_ns > self._bag.stop_ns:
            lasts_s = max(0.0, (self._bag.stop_ns - self._bag.start_ns) / NS_PER_S)
            raise ConfigurationError(
                f"{self._bag.path}: start_offset_s: {parameters.start_offset_s:g}; allowed: 0 to {lasts_s:.1f}"
            )
        self._outputs: dict[str, Any] = {}
        self._latched: dict[str, int] = {}  # messages kept of each latched topic
        self._connections = self._offer(self._chosen())
        if not self._connections:
            there = ", ".join(sorted({connection.topic for connection in self._bag.connections}))
            raise ConfigurationError(f"{self._bag.path}: nothing to play; allowed: --topics with patterns of: {there}")
        self._clock = self.publish_to(Clock, "/clock", _CLOCK_QOS)
        self._keep(self.host.make_service(SetBool, "~/pause", self._serve_pause))
        self._lock = threading.Lock()
        self._timeline = Timeline(self._first_ns, time.monotonic_ns(), parameters.rate)
        self._timeline.paused = parameters.paused
        self._told_ns = 0
        self._played = self._loops = 0

    def activate(self) -> None:
        """Begin to play."""
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._play, daemon=True, name="player")
        self._thread.start()

    def deactivate(self) -> None:
        """Stop playing."""
        self._stopping.set()
        if self._thread is not threading.current_thread():
            self._thread.join()
        self.host.info(f"{self._bag.path}: {self._played} messages played, {self._loops} time(s) to the end")

    def parameters_changed(self) -> None:
        """Another rate."""
        with self._lock:
            self._timeline.set_rate(self.parameters.rate, time.monotonic_ns())

    def health(self) -> Iterable[Health]:
        """What is played."""
        doing = "paused" if self._timeline.paused else f"playing at {self.parameters.rate:g} times"
        yield Health("playback", Level.OK, doing, {"messages": self._played, "loops": self._loops})

    def pause(self, *, paused: bool) -> None:
        """Let the clock stand still, or go on."""
        with self._lock:
            self._timeline.pause(time.monotonic_ns(), paused=paused)
        self.host.info("paused" if paused else "playing")

    def toggle_pause(self) -> None:
        """Pause, or go on."""
        self.pause(paused=not self._timeline.paused)

    # Topics.

    def _chosen(self) -> list[Connection]:
        topics = {connection.topic for connection in self._bag.connections}
        include, exclude = split_list(self.parameters.topics), split_list(self.parameters.exclude)
        for pattern in unmatched(include, topics):
            raise ConfigurationError(
                f"{pattern}: no such topic in {self._bag.path}; allowed: {', '.join(sorted(topics))}"
            )
        patterns = TopicPatterns.of(include, exclude)
        wanted = topics if include else played_by_default(topics)
        return [each for each in self._bag.connections if each.topic in wanted and patterns.admits(each.topic)
                and each.topic != "/clock"]  # fmt: skip

    def _offer(self, connections: Iterable[Connection]) -> list[Connection]:
        """Make the publishers; what is played. A topic whose type is not here, or is another here, is left out."""
        definitions = MessageDefinitions()
        offered: dict[str, str] = {}
        played = []
        for connection in connections:
            topic, msgtype = connection.topic, connection.msgtype
            try:
                kind = _class_of(connection, definitions)
                if offered.setdefault(topic, msgtype) != msgtype:
                    raise ConfigurationError(f"{msgtype}: its second type; allowed: {offered[topic]}")  # noqa: TRY301
            except ConfigurationError as error:
                self.host.warn(f"{topic}: not played: {error}")
                continue
            played.append(connection)
            if topic not in self._outputs:
                qos = to_publish(connection.ext.offered_qos_profiles, topic)
                if qos.durability == DurabilityPolicy.TRANSIENT_LOCAL:
                    self._latched[topic] = qos.depth
                self._outputs[topic] = self.publish_to(kind, topic, qos)
        return played

    # Playing, in the player's thread.

    def _play(self) -> None:
        try:
            self._await_subscribers()
            while not self._stopping.is_set():
                if not self._play_once():
                    return
                self._loops += 1
                if not self.parameters.loop:
                    break
        except Exception as error:  # noqa: BLE001 the thread must say why it ends
            self.problem = f"{self._bag.path}: {error}"
            self.host.error(self.problem)
        if not self._stopping.is_set():
            os.kill(os.getpid(), signal.SIGINT)

    def _play_once(self) -> bool:
        """Play from the offset to the end; False when asked to stop."""
        heads = self._bag.latched_before(self._connections, self._latched, self._first_ns)
        with contextlib.closing(self._bag.messages(self._connections, self._first_ns)) as messages:
            settled_s = time.monotonic() + _SETTLE_S
            while time.monotonic() < settled_s:
                self._tell(self._first_ns)
                if self._stopping.wait(_TICK_NS / NS_PER_S):
                    return False
            for connection, _, data in heads:
                self._outputs[connection.topic].publish(data)
            with self._lock:
                self._timeline.set(self._first_ns, time.monotonic_ns())
            for connection, stamp_ns, data in messages:
                if not self._wait_until(stamp_ns):
                    return False
                self._outputs[connection.topic].publish(data)
                self._played += 1
        return True

    def _wait_until(self, stamp_ns: int) -> bool:
        """Keep the clock going until a message is due; False when asked to stop.

        The clock never passes a message that was not published, and waits for a player that cannot keep up.
        """
        while not self._stopping.is_set():
            with self._lock:
                now_ns = time.monotonic_ns()
                wait_ns = self._timeline.wait_ns(stamp_ns, now_ns)
                if wait_ns == 0:
                    self._timeline.hold(stamp_ns, _MOST_BEHIND_NS, now_ns)
                bag_ns = min(self._timeline.bag_ns(now_ns), stamp_ns)
            if bag_ns - self._told_ns >= _TICK_NS or wait_ns is None or wait_ns > _TICK_NS:
                self._tell(bag_ns)
            if wait_ns == 0:
                return True
            time.sleep((_TICK_NS if wait_ns is None else min(wait_ns, _TICK_NS)) / NS_PER_S)
        return False

    def _tell(self, bag_ns: int) -> None:
        self._told_ns = bag_ns
        self._clock.publish(Clock(clock=to_time(bag_ns)))

    def _await_subscribers(self) -> None:
        """Tell the time, and wait until no further subscriber turns up."""
        began_s = changed_s = time.monotonic()
        heard = 0
        while not self._stopping.wait(_TICK_NS / NS_PER_S):
            self._tell(self._first_ns)
            now_s = time.monotonic()
            found = sum(output.get_subscription_count() for output in self._outputs.values())
            if found != heard:
                heard, changed_s = found, now_s
            if now_s - began_s > _LONGEST_MATCH_S or (heard and now_s - changed_s > _MATCH_S):
                return

    def _serve_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self.pause(paused=request.data)
        response.success, response.message = True, "paused" if request.data else "playing"
        return response


def _class_of(connection: Connection, definitions: MessageDefinitions) -> Any:
    """The class of a recorded topic. Raises ConfigurationError where it is not here as it was recorded."""
    _, installed = definitions.find(connection.msgtype)
    recorded = connection.digest or type_hash(connection.msgtype, connection.msgdef.data)
    if recorded not in {"", installed}:
        raise ConfigurationError(
            f"{connection.msgtype}: another version is installed here; allowed: the one of the bag"
        )
    return message_class(connection.msgtype)


def play(words: list[str], made: list[Player]) -> int:
    """Run a player, put into `made`, with these ROS arguments; exit status 1 where the bag could not be played."""
    sys.argv[1:] = words
    status = run(Player, made.append)
    return 1 if made and made[0].problem else status


if __name__ == "__main__":
    sys.exit(run(Player))
