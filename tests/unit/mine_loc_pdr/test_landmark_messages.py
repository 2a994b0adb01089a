"""Verdicts as messages, and poses in the map as somebody gives them."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from mine_loc_interfaces.msg import LandmarkFix as Message

from mine_loc_core.errors import MineLocError
from mine_loc_core.site import TurnMarker
from mine_loc_core.stamps import to_stamp_ns
from mine_loc_pdr.nodes.landmark_messages import UNKNOWN_SD_M, UNKNOWN_YAW_SD_RAD, to_landmark_fix, to_map_pose
from mine_loc_pdr.pseudo_plane import MARKER_SD_M, LandmarkFix, Verdict
from mine_loc_pdr.turns import Turn

MARKER = TurnMarker("corner", (1.0, 2.0, -3.0), (math.pi,), 4.0)
TURN = Turn(5, 6, 7, 0.0, 3.0, 0.01)


def given(yaw_deg=90.0, frame="map", **variances):
    message = PoseWithCovarianceStamped()
    message.header.frame_id = frame
    message.pose.pose.position.x, message.pose.pose.position.y = 4.0, 5.0
    message.pose.pose.orientation.w = math.cos(math.radians(yaw_deg) / 2)
    message.pose.pose.orientation.z = math.sin(math.radians(yaw_deg) / 2)
    for name, value in variances.items():
        message.pose.covariance[{"x": 0, "xy": 1, "yx": 6, "y": 7, "yaw": 35}[name]] = value
    return message


def test_a_match_has_the_marker_and_its_covariance():
    message = to_landmark_fix(LandmarkFix(TURN, Verdict.MATCHED, MARKER, 0.5), "fitter", "mine")
    assert (message.verdict, message.marker_id, message.person) == (Message.MATCHED, "corner", "fitter")
    assert (message.position.x, message.position.y, message.position.z) == (1.0, 2.0, -3.0)
    assert (message.header.frame_id, to_stamp_ns(message.header.stamp)) == ("mine", 6)
    assert np.diag(np.reshape(message.position_covariance, (3, 3)))[:2] == pytest.approx(2 * [MARKER_SD_M**2])
    assert (message.turn_angle, message.distance) == pytest.approx((3.0, 0.5))


@pytest.mark.parametrize("verdict", [Verdict.AMBIGUOUS, Verdict.NO_MARKER_NEAR, Verdict.ANGLE_NOT_ALLOWED])
def test_a_refused_turn_has_no_position(verdict):
    message = to_landmark_fix(LandmarkFix(TURN, verdict, None, 0.5), "fitter", "map")
    assert message.verdict == getattr(Message, verdict.name)
    assert message.marker_id == ""
    assert math.isnan(message.position.x)


def test_a_pose_is_read_on_the_ground_plan():
    pose = to_map_pose(given(x=0.04, y=0.09, xy=0.01, yx=0.01, yaw=0.02), "map")
    assert (pose.x_m, pose.y_m, math.degrees(pose.yaw_rad)) == pytest.approx((4.0, 5.0, 90.0))
    assert pose.covariance == pytest.approx(np.array([[0.04, 0.01, 0.0], [0.01, 0.09, 0.0], [0.0, 0.0, 0.02]]))


def test_variances_of_zero_are_not_known():
    assert np.diag(to_map_pose(given(), "map").covariance) == pytest.approx(
        [UNKNOWN_SD_M**2, UNKNOWN_SD_M**2, UNKNOWN_YAW_SD_RAD**2]
    )


@pytest.mark.parametrize(
    ("message", "why"),
    [
        (given(frame="odom"), "frame_id"),
        (given(x=math.nan), "not finite"),
        (given(yaw_deg=math.nan), "not finite"),
        (given(x=0.01, y=0.01, xy=0.5, yx=0.5), "semi-definite"),
    ],
)
def test_a_pose_that_is_none_is_refused_with_the_reason(message, why):
    with pytest.raises(MineLocError, match=why):
        to_map_pose(message, "map")


def test_a_pose_without_an_orientation_is_refused():
    message = given()
    message.pose.pose.orientation.w = message.pose.pose.orientation.z = 0.0
    with pytest.raises(MineLocError, match="quaternion"):
        to_map_pose(message, "map")
