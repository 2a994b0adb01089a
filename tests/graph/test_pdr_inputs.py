"""The pdr node by itself: what it learns of field, positions and walking, what it says when they are missing."""

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from graph.observer import Observer
from graph.processes import node_command, running
from graph.walker import ROLL_RAD_S, SWAY_M_S2, write_site
from mine_loc_interfaces.msg import Step, StrideUpdate, UwbPose, VelocityChange
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, MagneticField
from tf2_msgs.msg import TFMessage

from mine_loc_core import quaternion
from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.qos import EVENTS, LATCHED
from mine_loc_core.stamps import to_stamp_ns
from mine_loc_pdr.mounting import FORWARD_PHASE_RAD

pytestmark = pytest.mark.graph

STEP_HZ, SPEED_M_S = 1.8, 1.1
TAG = 17
STATUS = "pdr: walker"


@pytest.fixture
def sensors(tmp_path: Path, domain: int, observer: Observer) -> Iterator["Sensors"]:
    people = [{"name": "walker", "tag_id": TAG, "height_m": 1.75, "n100": {"port": "/dev/none"}}]
    site = write_site(tmp_path / "site", [], people)
    with running(node_command("mine_loc_pdr.nodes.pdr", {"site": str(site)}), domain, tmp_path / "pdr.log"):
        yield Sensors(observer)


class Sensors:
    """Publishes the walk of somebody whose sensor's x axis points to her left, as fast as the node takes it."""

    def __init__(self, observer: Observer) -> None:
        self._observer, node = observer, observer.node
        self._odometry = observer.listen(Odometry, "/walker/odometry")
        self._imu = node.create_publisher(Imu, "/walker/imu/data", EVENTS)
        self._mag = node.create_publisher(MagneticField, "/walker/imu/mag", EVENTS)
        self._pose = node.create_publisher(UwbPose, "/uwb/pose", EVENTS)
        ends = (self._imu, self._mag, self._pose)
        observer.wait_for(lambda: all(end.get_subscription_count() for end in ends), what="the node's subscriptions")
        observer.wait_for(lambda: observer.level(STATUS) is not None, what="the node's report")

    def walk(self, seconds: float, *, field: bool = False, positions: bool = False) -> None:
        for k in range(round(100 * seconds)):
            self._imu.publish(imu_at(k))
            if field and k % 10 == 0:
                self._mag.publish(field_at(k))
            if positions and k % 20 == 0:
                self._pose.publish(position_at(k))
            if k >= 100 and k % 50 == 0:
                self._observer.wait_for(lambda k=k: self._taken_ns() >= stamp_ns(k - 10), what=f"sample {k}")

    def _taken_ns(self) -> int:
        return to_stamp_ns(self._odometry.messages[-1].header.stamp) if self._odometry.messages else 0


def stamp_ns(k: int) -> int:
    return 10**18 + k * 10**7


def imu_at(k: int) -> Imu:
    t_s = 0.01 * k - 1.0
    phase, walking = math.tau * STEP_HZ * t_s, t_s > 0.0
    imu = Imu()
    imu.header.stamp = to_time(stamp_ns(k))
    imu.linear_acceleration.y = -0.8 * math.sin(phase + FORWARD_PHASE_RAD) if walking else 0.0
    imu.linear_acceleration.z = 9.80665 + (2.5 * math.sin(phase) if walking else 0.0)
    if walking:  # the pelvis sways and rolls once a stride
        imu.linear_acceleration.x = SWAY_M_S2 * math.sin(0.5 * phase)
        imu.angular_velocity.y = ROLL_RAD_S * math.cos(0.5 * phase)
    return imu


def field_at(k: int) -> MagneticField:
    mag = MagneticField()
    mag.header.stamp = to_time(stamp_ns(k))
    mag.magnetic_field.y, mag.magnetic_field.z = 30e-6, -40e-6
    return mag


def position_at(k: int) -> UwbPose:
    pose = UwbPose(tag_id=TAG, status=UwbPose.OK)
    pose.header.stamp, pose.header.frame_id = to_time(stamp_ns(k)), "map"
    pose.pose.pose.position.y = max(0.0, 0.01 * k - 1.0) * SPEED_M_S
    pose.pose.covariance = np.diag([0.01] * 6).ravel()
    return pose


def said(observer: Observer, key: str) -> str | None:
    """A value of the walker's last report."""
    status = observer.status.get(STATUS)
    return next((item.value for item in status.values if item.key == key), None) if status else None


def test_of_field_and_positions_the_node_learns_and_tells(sensors, observer):
    strides = observer.listen(StrideUpdate, "/pdr/stride_updates")
    sensors.walk(50.0, field=True, positions=True)
    observer.wait_for(lambda: len(strides) >= 2, what="two stride updates")
    update = strides.messages[-1]
    assert update.person == "walker"
    assert update.steps_used > 20
    assert 0.0 < update.k_variance < 0.06**2
    observer.wait_for(lambda: said(observer, "field_used"), what="the field in use")
    assert said(observer, "magnetometer") == "heard"
    assert float(said(observer, "stride_k").split()[0]) == pytest.approx(update.k, abs=0.001)


def test_while_there_are_no_steps_changes_of_velocity_are_told(sensors, observer):
    steps, changes = observer.listen(Step, "/pdr/steps"), observer.listen(VelocityChange, "/pdr/velocity_changes")
    sensors.walk(6.0)
    observer.wait_for(lambda: len(steps) >= 5, what="steps")
    standing = [each for each in changes.messages if to_stamp_ns(each.header.stamp) <= stamp_ns(100)]
    assert [each.count for each in standing] == [1, 2, 3, 4]  # the horizon takes half of the second of standing
    for each in standing:
        assert (each.person, each.header.frame_id) == ("walker", "walker/odom")
        assert each.interval == pytest.approx(0.1, abs=1e-6)
        assert (each.change.x, each.change.y, each.change.z) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    second_ns = to_stamp_ns(steps.messages[1].header.stamp)
    assert max(to_stamp_ns(each.header.stamp) for each in changes.messages) < second_ns + 5 * 10**8


def test_without_magnetometer_the_node_says_so_and_walks_on(sensors, observer):
    sensors.walk(20.0)
    observer.wait_for(lambda: int(said(observer, "steps") or 0) > 25, what="steps in the report")
    assert said(observer, "magnetometer") == "absent"
    assert observer.level(STATUS) == 0


def test_the_place_of_the_sensor_on_the_body_is_found_and_kept_for_latecomers(sensors, observer):
    sensors.walk(15.0)
    observer.wait_for(lambda: said(observer, "front_yaw_deg"), what="the front")
    transforms = observer.listen(TFMessage, "/tf_static", LATCHED)
    observer.wait_for(lambda: len(transforms) > 0, what="the transform")
    (transform,) = transforms.messages[-1].transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("walker/base_link", "walker/imu_link")
    q = transform.transform.rotation
    left = quaternion.rotate((q.w, q.x, q.y, q.z), (1.0, 0.0, 0.0))
    assert left == pytest.approx((0.0, 1.0, 0.0), abs=math.sin(math.radians(10.0)))
