"""Integer nanoseconds and tuples to ROS messages and back."""

import math
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Quaternion

from mine_loc_core.stamps import NS_PER_S


def to_time(stamp_ns: int) -> Time:
    """Nanoseconds since the epoch to builtin_interfaces/Time."""
    return Time(sec=stamp_ns // NS_PER_S, nanosec=stamp_ns % NS_PER_S)


def to_yaw_rad(orientation: Quaternion) -> float:
    """Angle about the vertical of a unit quaternion, as REP 103 has it."""
    q = orientation
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y**2 + q.z**2))


def to_point(position_m: Sequence[float]) -> Point:
    """(x, y, z) in m to geometry_msgs/Point."""
    return Point(x=float(position_m[0]), y=float(position_m[1]), z=float(position_m[2]))
