"""Quality of service between ROS and bags."""

from collections.abc import Sequence

from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

from mine_loc_core.nodes.qos import EVENTS, LATCHED
from mine_loc_core.stamps import NS_PER_S

STATIC_TRANSFORMS = 100
"""Messages kept of /tf_static, to which each of many publishers adds its own."""

_DEPTH = 5000  # of a subscription: half a second of 10 000 messages a second, while the writer has the interpreter


def to_subscribe(offered: Sequence[QoSProfile]) -> QoSProfile:
    """The strictest profile that hears every publisher: reliable, or latched, where all of them are."""
    reliable = all(profile.reliability == ReliabilityPolicy.RELIABLE for profile in offered)
    latched = all(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for profile in offered)
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=_DEPTH,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def to_bag(offered: Sequence[QoSProfile]) -> tuple[Qos, ...]:
    """The different profiles of a topic's publishers, as a bag holds them."""
    return tuple(dict.fromkeys(_to_bag(profile) for profile in offered))


def to_publish(recorded: Sequence[Qos], topic: str) -> QoSProfile:
    """A profile whose publisher every subscriber of the recorded ones hears.

    DDS does not tell how much history a publisher keeps, so that is ours. Deadline, lifespan and liveliness are left
    out: a replay that is paused or slow would break them.
    """
    if not recorded:
        return LATCHED if is_static(topic) else EVENTS
    reliable = any(profile.reliability == QosReliability.RELIABLE for profile in recorded)
    latched = any(profile.durability == QosDurability.TRANSIENT_LOCAL for profile in recorded)
    depth = STATIC_TRANSFORMS if is_static(topic) else LATCHED.depth if latched else EVENTS.depth
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=max(depth, *(profile.depth for profile in recorded)),
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def is_static(topic: str) -> bool:
    """Whether a topic is /tf_static, in whatever namespace."""
    return topic.endswith("/tf_static")


def latched_depth(topic: str, offered: Sequence[QoSProfile]) -> int:
    """How many messages of a topic a late subscriber would get; DDS tells of one a latched publisher."""
    if is_static(topic):
        return STATIC_TRANSFORMS
    return sum(max(1, profile.depth) for profile in offered if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL)


def _to_bag(profile: QoSProfile) -> Qos:
    return Qos(
        QosHistory(int(profile.history)),
        profile.depth,
        QosReliability(int(profile.reliability)),
        QosDurability(int(profile.durability)),
        _to_time(profile.deadline),
        _to_time(profile.lifespan),
        QosLiveliness(int(profile.liveliness)),
        _to_time(profile.liveliness_lease_duration),
        profile.avoid_ros_namespace_conventions,
    )


def _to_time(duration: Duration) -> QosTime:
    return QosTime(*divmod(duration.nanoseconds, NS_PER_S))
