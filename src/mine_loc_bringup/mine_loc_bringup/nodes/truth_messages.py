"""What is true, as bags carry it: truth/<person>/pose, truth/steps, truth/link_state."""

from collections.abc import Sequence
from math import nan

from geometry_msgs.msg import PoseStamped
from mine_loc_interfaces.msg import LinkState, Step

from mine_loc_core.nodes.conversions import to_point, to_time


def to_true_pose(
    stamp_ns: int, frame: str, position_m: Sequence[float], orientation_wxyz: Sequence[float]
) -> PoseStamped:
    """Where somebody was."""
    message = PoseStamped()
    message.header.stamp = to_time(stamp_ns)
    message.header.frame_id = frame
    message.pose.position = to_point(position_m)
    q = message.pose.orientation
    q.w, q.x, q.y, q.z = orientation_wxyz
    return message


def to_true_step(
    person: str,
    stamp_ns: int,
    *,
    length_m: float = nan,
    heading_rad: float = nan,
    position_m: Sequence[float] = (nan, nan, nan),
) -> Step:
    """A heel strike; NaN = not known. Unlike those of `pdr` it is told in the map."""
    message = Step(person=person, length=length_m, heading=heading_rad, confidence=1.0, interval=nan)
    message.header.stamp = to_time(stamp_ns)
    message.header.frame_id = "map"
    message.position = to_point(position_m)
    return message


def to_true_link(stamp_ns: int, tag_id: int, anchor_id: int, allowed: Sequence[bool]) -> LinkState:
    """Which of the classes 1 to 4 a link may be in; those that are allowed share the probability alike."""
    share = [float(each) / sum(allowed) for each in allowed]
    message = LinkState(
        tag_id=tag_id,
        anchor_id=anchor_id,
        most_likely_class=list(allowed).index(True) + 1,
        class_probability=share,
        los_probability=share[2] + share[3],
    )
    message.header.stamp = to_time(stamp_ns)
    return message
