"""Proximity between ROS messages and the pure types."""

import math
from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Pose
from mine_loc_interfaces import msg

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.nodes.conversions import to_time, to_yaw_rad
from mine_loc_core.stamps import to_stamp_ns
from mine_loc_fusion.mode import Mode
from mine_loc_fusion.possible_presence import DoubtRule, SeenPerson
from mine_loc_fusion.presence import PresenceRule
from mine_loc_fusion.proximity import MOST_ALARMS, Alarm, Pose2, ProximityRules
from mine_loc_fusion.proximity_guard import GuardRules
from mine_loc_fusion.proximity_parameters import ProximityParameters


def to_seen(person: msg.PersonPose) -> SeenPerson:
    """What proximity uses of a pose; a mode it does not know is UNKNOWN."""
    position = person.pose.pose.position
    covariance = np.asarray(person.pose.covariance).reshape(6, 6)[:2, :2].copy()
    mode = Mode(person.mode) if person.mode in set(Mode) else Mode.UNKNOWN
    return SeenPerson(person.person, to_stamp_ns(person.stamp), np.array([position.x, position.y]), covariance, mode)


def to_pose2(pose: Pose) -> Pose2:
    """A pose on the ground plan; yaw is NaN for an orientation that is none."""
    q = pose.orientation
    norm = math.sqrt(q.w**2 + q.x**2 + q.y**2 + q.z**2)
    if not 0.9 < norm < 1.1:
        return Pose2(pose.position.x, pose.position.y, math.nan)
    return Pose2(pose.position.x, pose.position.y, to_yaw_rad(q))


def to_guard_rules(p: ProximityParameters) -> GuardRules:
    """The rules that the parameters state. Raises ConfigurationError where an alarm would end before it begins."""
    for kind, enter, leave in (
        ("warning", p.warning_enter, p.warning_leave),
        ("danger", p.danger_enter, p.danger_leave),
    ):
        if leave >= enter:
            allowed = f"below {kind}_enter, {enter:g}"
            raise ConfigurationError(f"proximity: {kind}_leave: {leave:g} is not allowed; allowed: {allowed}")
    return GuardRules(
        ProximityRules(
            PresenceRule(p.warning_enter, p.warning_leave, p.warning_dwell_s, p.leave_dwell_s),
            PresenceRule(p.danger_enter, p.danger_leave, p.danger_dwell_s, p.leave_dwell_s),
        ),
        DoubtRule(p.pose_timeout_s, p.vague_m, p.top_speed_m_s),
        p.silence_s,
        p.alive_s,
        p.vehicle_timeout_s,
    )


def to_alarm_array(alarms: Sequence[Alarm], stamp_ns: int, frame_id: str) -> msg.ProximityAlarmArray:
    """All alarms, the worst first; what does not fit the message is left out at the end."""
    array = msg.ProximityAlarmArray()
    array.header.stamp = to_time(stamp_ns)
    array.header.frame_id = frame_id
    array.alarms = [
        msg.ProximityAlarm(
            zone_id=alarm.zone_id,
            person=alarm.person,
            level=int(alarm.level),
            event=int(alarm.event),
            probability=alarm.probability,
            distance=alarm.distance_m,
            since=to_time(alarm.since_ns),
            latched=alarm.latched,
        )
        for alarm in alarms[:MOST_ALARMS]
    ]
    return array
