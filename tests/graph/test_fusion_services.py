"""A fusion node by itself: told where people are, told what to leave out, given regions, serving some of the people."""

import itertools
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from graph.observer import Heard, Observer
from graph.processes import node_command, running
from graph.walker import ANCHORS, TAG_HEIGHT_M, VISITOR_TAG, WALKER_TAG, person, write_site
from mine_loc_interfaces import msg
from mine_loc_interfaces.srv import SetPose, ToggleSensor

from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.qos import EVENTS
from mine_loc_core.stamps import NS_PER_S

pytestmark = pytest.mark.graph

AT_M = (8.0, 12.0)
TAGS = {"walker": WALKER_TAG, "visitor": VISITOR_TAG}
PERIOD_S = 0.1


@dataclass
class Fusion:
    """The node under test, what it says, and the topics it listens to."""

    observer: Observer
    poses: Heard
    verdicts: Heard
    epochs: object
    regions: object
    sent_s: float = 0.0

    def last(self, name: str = "walker") -> msg.PersonPose | None:
        entries = [entry for array in self.poses.messages for entry in array.people if entry.person == name]
        return entries[-1] if entries else None

    def mode(self, name: str = "walker") -> int | None:
        last = self.last(name)
        return None if last is None else last.mode

    def reasons(self, name: str = "walker") -> list[int]:
        """Of the last verdicts on somebody's measurements."""
        arrays = [array for array in self.verdicts.messages if array.person == name]
        return [verdict.reason for verdict in arrays[-1].verdicts] if arrays else []

    def range(self, *names: str) -> None:
        """Send a round of everybody's, if the last one is a while ago."""
        if time.monotonic() - self.sent_s < PERIOD_S:
            return
        self.sent_s = time.monotonic()
        for name in names or ("walker",):
            array = msg.UwbRangeArray(tag_id=TAGS[name])
            for anchor, place in ANCHORS.items():
                true_m = math.dist((*AT_M, TAG_HEIGHT_M), place)
                value_m = true_m + 0.01 * math.sin(anchor + 7.0 * self.sent_s)
                array.ranges.append(msg.UwbRange(anchor_id=anchor, range=value_m, range_variance=0.01))
            epoch = msg.Epoch(person=name, ranges=[array])
            epoch.header.stamp = to_time(time.time_ns())
            self.epochs.publish(epoch)

    def ranging_until(self, happened, what: str, *names: str) -> None:
        def sent_and_happened() -> bool:
            self.range(*names)
            return happened()

        self.observer.wait_for(sent_and_happened, what=what)

    def toggle(self, source: int, *, enabled: bool) -> object:
        request = ToggleSensor.Request(person="walker", source=source, enabled=enabled)
        return self.observer.call(ToggleSensor, "/fusion/toggle_sensor", request)

    def set_pose(self, name: str, frame: str = "map", variance_m2: float = 0.25, stamp_ns: int = 0) -> object:
        pose = PoseWithCovarianceStamped()
        pose.header.stamp = to_time(stamp_ns)
        pose.header.frame_id = frame
        pose.pose.pose.position.x, pose.pose.pose.position.y = AT_M
        pose.pose.covariance[0] = pose.pose.covariance[7] = variance_m2
        return self.observer.call(SetPose, "/fusion/set_pose", SetPose.Request(person=name, pose=pose))


@pytest.fixture
def people() -> str:
    """The node's parameter `people`."""
    return ""


@pytest.fixture
def fusion(tmp_path: Path, domain: int, observer: Observer, people: str) -> Iterator[Fusion]:
    folder = write_site(tmp_path / "site", [], [person(name, tag) for name, tag in TAGS.items()])
    epochs = observer.node.create_publisher(msg.Epoch, "sync/epochs", EVENTS)
    regions = observer.node.create_publisher(msg.CoarseRegionArray, "coarse/regions", EVENTS)
    poses = observer.listen(msg.PersonPoseArray, "fused/poses")
    verdicts = observer.listen(msg.MeasurementVerdictArray, "fused/verdicts")
    parameters = {"site": folder} | ({"people": people} if people else {})
    with running(node_command("mine_loc_fusion.nodes.fusion", parameters), domain, tmp_path / "fusion.log") as run:
        observer.wait_for(lambda: observer.level("fusion: people") == 0, 60.0, "the node at work")
        observer.wait_for(lambda: epochs.get_subscription_count() and regions.get_subscription_count())
        yield Fusion(observer, poses, verdicts, epochs, regions)
        assert run.alive
        assert "Traceback" not in run.output


def test_who_is_told_to_be_somewhere_is_there_and_coasts(fusion):
    assert "nobody called 'ghost'" in fusion.set_pose("ghost").reason
    assert "'odom'" in fusion.set_pose("walker", frame="odom").reason
    assert "covariance" in fusion.set_pose("walker", variance_m2=0.0).reason
    ahead = fusion.set_pose("walker", stamp_ns=time.time_ns() + 60 * NS_PER_S)
    assert (ahead.success, "allowed: 50 ms (future_ms)" in ahead.reason) == (False, True)
    assert fusion.last() is None
    assert fusion.set_pose("walker", stamp_ns=time.time_ns()).success
    fusion.observer.wait_for(lambda: fusion.last() is not None, what="a pose")
    pose = fusion.last()
    assert (pose.pose.pose.position.x, pose.pose.pose.position.y) == pytest.approx(AT_M, abs=0.01)
    assert (pose.mode, pose.since_uwb) == (msg.PersonPose.COASTING, math.inf)
    assert fusion.last("visitor") is None


def test_ranges_left_out_are_disabled_and_the_person_coasts_until_they_count_again(fusion):
    fusion.ranging_until(lambda: fusion.mode() == msg.PersonPose.UWB_ONLY, "a position by ranges")
    assert fusion.reasons() == [msg.MeasurementVerdict.ACCEPTED] * len(ANCHORS)
    refusal = fusion.toggle(msg.MeasurementVerdict.HEADING, enabled=False)
    assert (refusal.success, "allowed" in refusal.reason) == (False, True)
    assert fusion.toggle(msg.MeasurementVerdict.RANGE, enabled=False).success
    fusion.ranging_until(lambda: fusion.mode() == msg.PersonPose.COASTING, "coasting")
    assert set(fusion.reasons()) == {msg.MeasurementVerdict.DISABLED}
    assert fusion.last().since_uwb >= 1.0
    assert fusion.toggle(msg.MeasurementVerdict.RANGE, enabled=True).success
    fusion.ranging_until(lambda: fusion.mode() == msg.PersonPose.UWB_ONLY, "ranges again")
    assert msg.MeasurementVerdict.ACCEPTED in fusion.reasons()


def test_between_ranges_changes_of_velocity_carry_a_person_who_does_not_step(fusion):
    fusion.ranging_until(lambda: fusion.mode() == msg.PersonPose.UWB_ONLY, "a position by ranges")

    def change() -> bool:
        """Send the change of the tenth of a second since the last."""
        fusion.range()
        change = msg.VelocityChange(person="walker", interval=0.1)
        epoch = msg.Epoch(person="walker", velocity_changes=[change])
        change.header.stamp = epoch.header.stamp = to_time(next(stamps))
        fusion.epochs.publish(epoch)
        return any(
            (verdict.source, verdict.reason) == (msg.MeasurementVerdict.IMU, msg.MeasurementVerdict.ACCEPTED)
            for array in fusion.verdicts.messages
            for verdict in array.verdicts
        )

    stamps = itertools.count(time.time_ns(), 10**8)
    fusion.observer.wait_for(change, what="a change that is used")


def test_a_region_starts_a_person_and_ranges_take_over(fusion):
    covariance = [100.0, 10.0, 10.0, 64.0]

    def publish(status: int, x_m: float) -> None:
        region = msg.CoarseRegion(person="walker", covariance=covariance, status=status)
        region.center.x, region.center.y = x_m, 4.0
        array = msg.CoarseRegionArray(regions=[region])
        array.header.stamp = to_time(time.time_ns())
        fusion.regions.publish(array)

    publish(msg.CoarseRegion.LOST, 90.0)  # says nothing, and would be heard first
    publish(msg.CoarseRegion.NEW, 2.0)
    fusion.observer.wait_for(lambda: fusion.last() is not None, what="a pose")
    first = next(entry for array in fusion.poses.messages for entry in array.people)
    assert (first.pose.pose.position.x, first.pose.pose.position.y) == pytest.approx((2.0, 4.0), abs=0.01)
    block = first.pose.covariance
    assert [block[0], block[1], block[6], block[7]] == pytest.approx(covariance, rel=0.01)
    assert first.mode == msg.PersonPose.COARSE_ONLY
    assert fusion.verdicts.messages[0].verdicts[0].source == msg.MeasurementVerdict.REGION
    fusion.ranging_until(lambda: fusion.mode() == msg.PersonPose.UWB_ONLY, "ranges")
    fusion.ranging_until(lambda: fusion.last().horizontal_ce95 < 1.0, "a sure place")
    pose = fusion.last().pose.pose.position
    assert (pose.x, pose.y) == pytest.approx(AT_M, abs=0.2)


@pytest.mark.parametrize("people", ["visitor"])
def test_an_instance_serves_the_people_it_is_told_and_no_others(fusion):
    fusion.ranging_until(lambda: fusion.mode("visitor") == msg.PersonPose.UWB_ONLY, "the visitor", "walker", "visitor")
    count = len(fusion.poses)
    fusion.ranging_until(lambda: len(fusion.poses) > count + 3, "more of the visitor", "walker", "visitor")
    assert {entry.person for array in fusion.poses.messages for entry in array.people} == {"visitor"}
    assert {array.person for array in fusion.verdicts.messages} == {"visitor"}
    refusal = fusion.set_pose("walker")
    assert (refusal.success, refusal.reason) == (False, "nobody called 'walker'; known: visitor")
    assert fusion.observer.node.count_publishers("people/walker/pose") == 0
    assert fusion.observer.node.count_publishers("people/visitor/pose") == 1
