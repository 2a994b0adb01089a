"""Records topics as they appear: serialised as they come, with what their publishers offer, never decoded."""

import sys
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.topic_endpoint_info import TopicEndpointInfo

from mine_loc_bringup.bags.bag_folder import BagFolder, SplitLimits, Storage
from mine_loc_bringup.bags.message_definitions import MessageDefinitions
from mine_loc_bringup.bags.patterns import TopicPatterns, split_list, unmatched
from mine_loc_bringup.bags.recording import Recording, RecordingStatus
from mine_loc_bringup.bags.topic import BagTopic
from mine_loc_bringup.message_types import message_class
from mine_loc_bringup.nodes.bag_qos import STATIC_TRANSFORMS, latched_depth, to_bag, to_subscribe
from mine_loc_bringup.parameters import RecorderParameters
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.node_base import NodeBase
from mine_loc_core.nodes.ros_host import RosHost, run
from mine_loc_core.stamps import NS_PER_S

_LOOK_S = 0.2
_WATCH_S = 0.5
_WAIT_S = 5.0
_BYTES_A_MB = 1_000_000


@dataclass(frozen=True, slots=True)
class _Heard:
    """A topic that is recorded, and how it is subscribed to."""

    msgtype: str
    qos: QoSProfile
    subscription: object


class Recorder(NodeBase):
    """A bag of what is published, from activation to deactivation."""

    default_name = "recorder"
    parameter_class = RecorderParameters
    parameters: RecorderParameters
    host: RosHost

    def __init__(self, host: RosHost) -> None:
        super().__init__(host)
        self.status: RecordingStatus | None = None
        """How the last recording ended."""

    def configure(self) -> None:
        """Read the patterns; look for topics."""
        parameters = self.parameters
        self._patterns = TopicPatterns.of(split_list(parameters.topics), split_list(parameters.exclude))
        self._definitions = MessageDefinitions()
        self._heard: dict[str, _Heard] = {}
        self._refused: dict[str, str] = {}
        self._early: deque[tuple[str, bytes]] = deque(maxlen=STATIC_TRANSFORMS)  # latched, before the clock began
        self._before_clock = 0
        self.every(_LOOK_S, self._look)
        self.every(_WATCH_S, self._watch)
        self._waiting = self.every(_WAIT_S, self._tell_waiting)

    def activate(self) -> None:
        """Begin the bag."""
        parameters = self.parameters
        self.path = Path(time.strftime(parameters.bag))
        limits = SplitLimits(
            size_bytes=round(parameters.split_size_mb * _BYTES_A_MB) or None,
            duration_ns=round(parameters.split_duration_s * NS_PER_S) or None,
        )
        bag = BagFolder(self.path, Storage(parameters.storage), limits)
        self._recording = Recording(bag, round(parameters.queue_mb * _BYTES_A_MB))
        self._told = ""
        self.host.info(f"recording to {self.path}")

    def deactivate(self) -> None:
        """End the bag, and forget the topics: the next one declares them anew."""
        self._tell_unmatched()
        self.release(*(heard.subscription for heard in self._heard.values()))
        self._heard = {}
        self.status = status = self._recording.close()
        held = (
            f"{status.messages} messages of {status.topics} topics in {status.parts} part(s), {status.dropped} dropped"
        )
        if status.problem:
            self.host.error(
                f"{status.problem}; the bag has no end: mine-loc bag repair {self.path} OUT opens it; {held} at most"
            )
        else:
            self.host.info(f"{self.path}: {held}")

    def clock_jumped(self, delta_ns: int) -> None:
        """Times of a part rise: one that would go back is followed by another."""
        if delta_ns < 0:
            self._recording.split()

    def health(self) -> Iterable[Health]:
        """How the recording goes."""
        status = self._recording.status
        values = {
            "messages": status.messages,
            "dropped": status.dropped,
            "before_clock": self._before_clock,
            "topics": status.topics,
            "parts": status.parts,
            "bytes": status.size_bytes,
        }
        if status.problem:
            yield Health("recording", Level.ERROR, status.problem, values)
        elif status.dropped:
            yield Health("recording", Level.WARN, f"{status.dropped} messages were dropped", values)
        else:
            yield Health("recording", Level.OK, f"{self.path}", values)
        if self._refused:
            yield Health("topics", Level.WARN, "; ".join(self._refused.values()), {"refused": len(self._refused)})

    def _look(self) -> None:
        """Subscribe to topics that appeared, and anew to those whose publishers now offer something else."""
        for name, _ in self.host.get_topic_names_and_types():
            if self._patterns.admits(name):
                publishers = self.host.get_publishers_info_by_topic(name)
                if publishers:
                    self._follow(name, publishers)

    def _follow(self, name: str, publishers: list[TopicEndpointInfo]) -> None:
        heard = self._heard.get(name)
        msgtype = heard.msgtype if heard else publishers[0].topic_type
        others = ", ".join(sorted({info.topic_type for info in publishers} - {msgtype}))
        if others:
            self._refuse(f"{name} as {others}", f"{name}: recorded as {msgtype} alone, and {others} is published too")
        publishers = [info for info in publishers if info.topic_type == msgtype]
        offered = [info.qos_profile for info in publishers]
        if not offered or name in self._refused:
            return
        qos = to_subscribe(offered)
        if heard and (heard.qos.reliability, heard.qos.durability) == (qos.reliability, qos.durability):
            return
        try:
            definition, type_hash = self._definitions.find(msgtype)
            kind = message_class(msgtype)
            check_version(msgtype, type_hash, publishers)
        except ConfigurationError as error:
            self._refuse(name, f"{name}: not recorded: {error}")
            return
        if heard:
            self.release(heard.subscription)
        else:
            depth = latched_depth(name, offered)
            self._recording.add_topic(BagTopic(name, msgtype, definition, type_hash, to_bag(offered), depth))
        latched = qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
        subscription = self.subscribe(kind, name, lambda data: self._take(name, data, latched=latched), qos, raw=True)
        self._heard[name] = _Heard(msgtype, qos, subscription)

    def _take(self, name: str, data: bytes, *, latched: bool) -> None:
        stamp_ns = self.now_ns()
        if stamp_ns:
            while self._early:
                self._recording.offer(self._early[0][0], stamp_ns, self._early.popleft()[1])
            self._recording.offer(name, stamp_ns, data)
        elif latched:
            self._early.append((name, data))
        else:
            self._before_clock += 1

    def _watch(self) -> None:
        """Say once when the disk takes no more, and when it does again."""
        status = self._recording.status
        if status.problem and not self._told:
            self.host.error(f"{status.problem}; what was written is safe, and recording goes on when there is room")
        elif self._told and not status.problem:
            self.host.info(f"recording goes on; {status.dropped} messages were dropped so far")
        self._told = status.problem

    def _refuse(self, key: str, reason: str) -> None:
        if key not in self._refused:
            self._refused[key] = reason
            self.host.warn(reason)

    def _tell_waiting(self) -> None:
        self._waiting.cancel()
        self._tell_unmatched()

    def _tell_unmatched(self) -> None:
        """Name the patterns of a single topic that no topic matched."""
        single = [pattern for pattern in split_list(self.parameters.topics) if "*" not in pattern]
        for pattern in unmatched(single, {*self._heard, *self._refused}):
            self.host.warn(f"{pattern}: nobody publishes a topic of this name")


def check_version(msgtype: str, type_hash: str, publishers: Iterable[TopicEndpointInfo]) -> None:
    """Raise ConfigurationError where a publisher's type is not what is installed under its name."""
    told = {str(info.topic_type_hash) for info in publishers}
    if any(each.startswith("RIHS01_") and each != type_hash for each in told):
        raise ConfigurationError(f"{msgtype}: published in another version; allowed: the one installed here")


def record(words: list[str]) -> int:
    """Run a recorder with these ROS arguments until SIGINT; exit status 1 where not all reached the disk."""
    sys.argv[1:] = words
    made: list[Recorder] = []
    status = run(Recorder, made.append)
    ended = made[0].status if made else None
    return 1 if ended and (ended.problem or ended.dropped) else status


if __name__ == "__main__":
    sys.exit(run(Recorder))
