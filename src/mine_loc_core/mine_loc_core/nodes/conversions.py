"""Integer nanoseconds and tuples to ROS messages and back."""

from collections.abc import Sequence

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point

from mine_loc_core.stamps import NS_PER_S


def to_time(stamp_ns: int) -> Time:
    """Nanoseconds since the epoch to builtin_interfaces/Time."""
    return Time(sec=stamp_ns // NS_PER_S, nanosec=stamp_ns % NS_PER_S)


def to_stamp_ns(time: Time) -> int:
    """builtin_interfaces/Time to nanoseconds since the epoch."""
    return time.sec * NS_PER_S + time.nanosec


def to_point(position_m: Sequence[float]) -> Point:
    """(x, y, z) in m to geometry_msgs/Point."""
    return Point(x=float(position_m[0]), y=float(position_m[1]), z=float(position_m[2]))
