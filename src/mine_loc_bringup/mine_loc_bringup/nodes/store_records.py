"""Messages to the rows of the store."""

import math

from mine_loc_interfaces import msg

from mine_loc_bringup.store.records import Alarm, Pose, RangeRound, Region, finite
from mine_loc_core.nodes.conversions import to_yaw_rad
from mine_loc_core.stamps import to_stamp_ns


def to_poses(array: msg.PersonPoseArray) -> list[Pose]:
    """One row a person."""
    return [_to_pose(person) for person in array.people]


def _to_pose(person: msg.PersonPose) -> Pose:
    pose, covariance = person.pose.pose, person.pose.covariance
    yaw_rad = to_yaw_rad(pose.orientation)
    numbers = (pose.position.x, pose.position.y, pose.position.z, yaw_rad, covariance[0], covariance[1], covariance[7])
    return Pose(
        _text(person.person),
        to_stamp_ns(person.stamp),
        *map(finite, numbers),
        finite(person.velocity.x),
        finite(person.velocity.y),
        finite(person.horizontal_ce95),
        person.mode,
        finite(person.since_uwb),
    )


def to_regions(array: msg.CoarseRegionArray) -> list[Region]:
    """One row a region."""
    stamp_ns = to_stamp_ns(array.header.stamp)
    return [
        Region(
            stamp_ns,
            region.region_id,
            _text(region.person),
            finite(region.center.x),
            finite(region.center.y),
            finite(region.radius),
            finite(region.probability),
            finite(region.confidence),
            region.status,
            to_stamp_ns(region.last_heard),
            _text(" ".join(region.galleries)),
        )
        for region in array.regions
    ]


def to_alarms(array: msg.ProximityAlarmArray) -> list[Alarm]:
    """One row an alarm, at the stamp of the array."""
    stamp_ns = to_stamp_ns(array.header.stamp)
    return [
        Alarm(
            stamp_ns,
            _text(alarm.person),
            _text(alarm.zone_id),
            alarm.level,
            alarm.latched,
            finite(alarm.probability),
            finite(alarm.distance),
        )
        for alarm in array.alarms
    ]


def to_range_round(array: msg.UwbRangeArray) -> RangeRound:
    """A summary of a round."""
    judged = [item.los_probability for item in array.ranges if math.isfinite(item.los_probability)]
    ranges_m = [item.range for item in array.ranges if math.isfinite(item.range)]
    return RangeRound(
        to_stamp_ns(array.header.stamp),
        array.tag_id,
        array.reporter_id,
        len(array.ranges),
        sum(judged) / len(judged) if judged else None,
        min(ranges_m, default=None),
        max(ranges_m, default=None),
    )


def _text(text: str) -> str:
    return text.replace("\0", "")  # PostgreSQL takes none
