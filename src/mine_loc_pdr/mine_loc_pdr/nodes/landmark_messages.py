"""Turns matched to markers, and poses given for a track in the map, to messages and back."""

import math

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from mine_loc_interfaces.msg import LandmarkFix as LandmarkFixMessage
from std_msgs.msg import Header

from mine_loc_core.errors import MineLocError
from mine_loc_core.nodes.conversions import to_point, to_time, to_yaw_rad
from mine_loc_core.stamps import to_stamp_ns
from mine_loc_pdr.map_track import MapPose
from mine_loc_pdr.pseudo_plane import MARKER_SD_M, LandmarkFix

UNKNOWN_SD_M, UNKNOWN_YAW_SD_RAD = 0.5, math.radians(10.0)  # of a pose that comes without variances
_FLOOR_SD_M = 0.1  # of a marker's height
_PLANE = [0, 1, 5]  # x, y and yaw among the six of a pose's covariance


def to_landmark_fix(fix: LandmarkFix, person: str, map_frame: str) -> LandmarkFixMessage:
    """One turn's verdict; without a match the position is NaN, its covariance zero and `marker_id` empty."""
    message = LandmarkFixMessage(
        header=Header(stamp=to_time(fix.turn.middle_ns), frame_id=map_frame),
        person=person,
        turn_angle=fix.turn.angle_rad,
        distance=fix.distance_m,
        verdict=int(fix.verdict),
    )
    if fix.marker is None:
        message.position = to_point((math.nan, math.nan, math.nan))
        return message
    message.marker_id = fix.marker.id
    message.position = to_point(fix.marker.position_m)
    message.position_covariance = np.diag([MARKER_SD_M**2, MARKER_SD_M**2, _FLOOR_SD_M**2]).ravel().tolist()
    return message


def to_map_pose(message: PoseWithCovarianceStamped, map_frame: str) -> MapPose:
    """A pose on the ground plan; variances of 0 count as not known.

    Raises MineLocError for another frame, values that are not finite, no orientation or no covariance.
    """
    frame = message.header.frame_id
    if frame != map_frame:
        raise MineLocError(f"pose.header.frame_id: {frame!r}; allowed: {map_frame!r}")
    place, q = message.pose.pose.position, message.pose.pose.orientation
    covariance = np.array(message.pose.covariance, dtype=float).reshape(6, 6)[np.ix_(_PLANE, _PLANE)]
    if not np.isfinite([place.x, place.y, q.w, q.x, q.y, q.z, *covariance.ravel()]).all():
        raise MineLocError("pose: not finite")
    if not abs(math.hypot(q.w, q.x, q.y, q.z) - 1.0) < 0.01:
        raise MineLocError("pose.orientation: allowed: a unit quaternion")
    known = np.where(np.diag(covariance) > 0.0, 0.0, [UNKNOWN_SD_M**2, UNKNOWN_SD_M**2, UNKNOWN_YAW_SD_RAD**2])
    covariance = 0.5 * (covariance + covariance.T) + np.diag(known)
    if np.linalg.eigvalsh(covariance)[0] < 0.0:
        raise MineLocError("pose.covariance: allowed: a positive semi-definite one")
    return MapPose(to_stamp_ns(message.header.stamp), place.x, place.y, to_yaw_rad(q), covariance)
