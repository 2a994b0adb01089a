"""Samples of a walk round a marked corner become a fix on pdr/landmark_fix, once the node was told the start."""

import math
import time
from typing import Any

import pytest
import yaml
from geometry_msgs.msg import PoseWithCovarianceStamped
from graph.observer import Observer
from graph.processes import node_command, running
from graph.walker import ROLL_RAD_S, SWAY_M_S2, person, write_site
from mine_loc_interfaces.msg import LandmarkFix
from mine_loc_interfaces.srv import SetPose
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu

from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.qos import EVENTS
from mine_loc_core.stamps import to_stamp_ns

pytestmark = pytest.mark.graph

STEP_HZ, PERIOD_S = 1.79, 0.01
STAND_S, TURN_S, TURN_TAKES_S, END_S = 2.0, 12.0, 1.2, 18.0
AT_A_TIME = 10  # samples: ten times as fast as life, and no queue runs over


def imu(at_s: float, start_ns: int) -> Imu:
    """Standing, walking with the bounce, sway and roll of a pelvis, and a quarter turn to the left."""
    walking, turning = at_s > STAND_S, 0.0 <= at_s - TURN_S < TURN_TAKES_S
    message = Imu()
    message.header.stamp = to_time(start_ns + round(at_s * 1e9))
    message.angular_velocity.z = math.pi / 2.0 / TURN_TAKES_S if turning else 0.0
    bounce = 2.5 * math.sin(math.tau * STEP_HZ * at_s) if walking else 0.0
    message.linear_acceleration.z = 9.80665 + bounce
    if walking:
        message.linear_acceleration.y = SWAY_M_S2 * math.sin(math.pi * STEP_HZ * at_s)
        message.angular_velocity.x = -ROLL_RAD_S * math.cos(math.pi * STEP_HZ * at_s)
    return message


class Samples:
    """Sends them in order, some more at each call."""

    def __init__(self, observer: Observer) -> None:
        self.publisher = observer.node.create_publisher(Imu, "/walker/imu/data", EVENTS)
        self.start_ns = time.time_ns()
        self.sent = 0

    def send(self, until_s: float) -> bool:
        """Whether all up to then are out."""
        for _ in range(AT_A_TIME):
            if self.sent * PERIOD_S < until_s:
                self.publisher.publish(imu(self.sent * PERIOD_S, self.start_ns))
                self.sent += 1
        return self.sent * PERIOD_S >= until_s


def start_at(observer: Observer, name: str, frame: str = "map") -> Any:
    """The origin of the map, facing east."""
    pose = PoseWithCovarianceStamped()
    pose.header.frame_id = frame
    pose.pose.pose.orientation.w = 1.0
    return observer.call(SetPose, "/pdr/set_pose", SetPose.Request(person=name, pose=pose))


def test_a_turn_at_a_marker_is_published_as_a_fix(tmp_path, domain, observer):
    folder = write_site(tmp_path / "site", [], [person("walker", 17, tmp_path / "n100")])
    site = yaml.safe_load((folder / "site.yaml").read_text())
    marker = {"id": "corner", "position_m": [13.0, 0.0, 0.0], "angles_deg": [90, -90], "radius_m": 6.0}
    (folder / "site.yaml").write_text(yaml.safe_dump(site | {"turn_markers": [marker]}))
    fixes, odometry = observer.listen(LandmarkFix, "pdr/landmark_fix"), observer.listen(Odometry, "walker/odometry")
    samples = Samples(observer)
    with running(node_command("mine_loc_pdr.nodes.pdr", {"site": folder}), domain, tmp_path / "pdr.log"):
        observer.wait_for(lambda: samples.publisher.get_subscription_count() == 1, what="the node")
        refusal = start_at(observer, "walker")
        assert (refusal.success, "horizon" in refusal.reason) == (False, True)
        observer.wait_for(lambda: samples.send(1.5), what="standing")
        observer.wait_for(lambda: len(odometry) > 0, what="a horizon")
        assert "wears no N100" in start_at(observer, "nobody").reason
        assert "'odom'" in start_at(observer, "walker", "odom").reason
        assert start_at(observer, "walker").success
        observer.wait_for(lambda: samples.send(END_S) and len(fixes) > 0, what="a fix")
    (fix,) = fixes.messages
    assert (fix.verdict, fix.marker_id, fix.person) == (LandmarkFix.MATCHED, "corner", "walker")
    assert (fix.position.x, fix.position.y, fix.header.frame_id) == (13.0, 0.0, "map")
    assert math.degrees(fix.turn_angle) == pytest.approx(90.0, abs=6.0)
    middle_s = (to_stamp_ns(fix.header.stamp) - samples.start_ns) / 1e9
    assert middle_s == pytest.approx(TURN_S + TURN_TAKES_S / 2.0, abs=0.2)
    assert fix.position_covariance[0] > 0.0
