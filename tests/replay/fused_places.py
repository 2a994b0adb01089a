"""Where people were said to be: the fused poses of a message, and of a bag."""

from pathlib import Path

from mine_loc_interfaces.msg import PersonPoseArray

from mine_loc_bringup.bag_messages import open_bag
from mine_loc_bringup.message_types import workspace_types
from mine_loc_core.stamps import to_stamp_ns

Places = dict[tuple[str, int], tuple[float, float, float]]
"""Person and stamp [ns] → x, y, z [m]."""


def places(array: PersonPoseArray) -> Places:
    """Of one message, of rclpy or of rosbags."""
    found: Places = {}
    for item in array.people:
        at = item.pose.pose.position
        found[item.person, to_stamp_ns(item.stamp)] = (at.x, at.y, at.z)
    return found


def places_of(bag: Path) -> Places:
    """Of all messages on fused/poses."""
    types, found = workspace_types(), {}
    with open_bag(bag) as opened:
        for message in opened.read({"/fused/poses"}):
            found |= places(types.deserialize_cdr(message.data, message.type_name))
    return found
