"""uwb_solver alone, live: its methods at run time, blinks, judgements of links, and anchors that ride on a vehicle."""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import yaml
from graph.domains import lent_domain
from graph.observer import Heard, Observer
from graph.processes import Running, node_command, running
from graph.walker import ANCHORS, TAG_HEIGHT_M, person, write_site
from mine_loc_interfaces.msg import (
    AnchorMap,
    Epoch,
    LinkState,
    LinkStateArray,
    MeasurementVerdict,
    MeasurementVerdictArray,
    TdoaArray,
    TdoaDifference,
    UwbPose,
    UwbRange,
    UwbRangeArray,
)
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue, SetParametersResult
from rcl_interfaces.srv import SetParameters

from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.qos import LATCHED
from mine_loc_uwb.parameters import RANGE_METHODS

pytestmark = pytest.mark.graph

MODULE = "mine_loc_uwb.nodes.uwb_solver"
PLACE = (7.0, 8.0, TAG_HEIGHT_M)


@dataclass
class Solver:
    """The running node, what it says, and a tag that measures; each message is answered before the next is sent."""

    run: Running
    observer: Observer
    poses: Heard = field(init=False)
    verdicts: Heard = field(init=False)

    def __post_init__(self) -> None:
        self.poses = self.observer.listen(UwbPose, "uwb/pose")
        self.verdicts = self.observer.listen(MeasurementVerdictArray, "uwb/verdicts")
        make = self.observer.node.create_publisher
        kinds = {UwbRangeArray: "uwb/ranges", TdoaArray: "uwb/tdoa", LinkStateArray: "uwb/link_state"}
        self._publishers = {kind: make(kind, topic, 10) for kind, topic in kinds.items()}
        self.observer.wait_for(
            lambda: all(publisher.get_subscription_count() for publisher in self._publishers.values()), what="the node"
        )
        self.observer.wait_for(lambda: self.observer.level("uwb_solver: callbacks") == 0, what="an active node")
        self._rng, self._seq = np.random.default_rng(1), 0

    def ask(self, message: UwbRangeArray | TdoaArray) -> tuple[UwbPose, dict[int, MeasurementVerdict]]:
        """Send what a tag measured now; the pose and the verdicts that answer it."""
        self._seq += 1
        message.seq = self._seq
        message.header.stamp = to_time(time.time_ns())
        before = len(self.verdicts)
        self._publishers[type(message)].publish(message)
        self.observer.wait_for(
            lambda: len(self.verdicts) > before and any(pose.seq == self._seq for pose in self.poses.messages)
        )
        return self.poses.messages[-1], {verdict.sensor_id: verdict for verdict in self.verdicts.messages[-1].verdicts}

    def range(self, tag: int, late: dict[int, float] | None = None, place: tuple[float, ...] = PLACE):
        """A round with 1 cm of noise, ranges of some anchors late by so much."""
        late = late or {}
        ranges = [
            UwbRange(
                anchor_id=anchor,
                range=math.dist(at, place) + self._rng.normal(0.0, 0.01) + late.get(anchor, 0.0),
                range_variance=0.01,
                los_probability=math.nan,
            )
            for anchor, at in ANCHORS.items()
        ]
        return self.ask(UwbRangeArray(tag_id=tag, ranges=ranges))

    def tell(self, tag: int, anchor: int, los_probability: float) -> None:
        state = LinkState(tag_id=tag, anchor_id=anchor, los_probability=los_probability)
        array = LinkStateArray(states=[state])
        array.header.stamp = to_time(time.time_ns())
        self._publishers[LinkStateArray].publish(array)

    def set_method(self, method: str) -> SetParametersResult:
        value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=method)
        request = SetParameters.Request(parameters=[Parameter(name="method", value=value)])
        (result,) = self.observer.call(SetParameters, "/uwb_solver/set_parameters", request).results
        return result


@pytest.fixture(scope="module")
def solver(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Solver]:
    folder = tmp_path_factory.mktemp("methods")
    command = node_command(MODULE, {"site": write_site(folder / "site", [], [])})
    with lent_domain() as domain:
        observer = Observer(domain)
        try:
            with running(command, domain, folder / "solver.log") as run:
                yield Solver(run, observer)
        finally:
            observer.close()


def error_m(pose: UwbPose) -> float:
    at = pose.pose.pose.position
    return math.dist((at.x, at.y, at.z), PLACE)


@pytest.mark.parametrize("method", [*RANGE_METHODS, RANGE_METHODS[0]])
def test_the_method_changes_at_run_time_and_poses_say_which_it_was(solver, method):
    assert solver.set_method(method).successful
    for _ in range(3):
        pose, verdicts = solver.range(tag=21)
        assert (pose.method, pose.status) == (method, UwbPose.OK)
        assert {verdict.reason for verdict in verdicts.values()} == {MeasurementVerdict.ACCEPTED}
        assert pose.ranges_used == len(verdicts) == len(ANCHORS)
    assert error_m(pose) < 0.1


def test_an_unknown_method_is_refused_with_the_allowed_ones_and_changes_nothing(solver):
    assert solver.set_method("least_squares").successful
    refusal = solver.set_method("guessing")
    assert not refusal.successful
    assert "method" in refusal.reason
    assert "guessing" in refusal.reason
    for method in RANGE_METHODS:
        assert method in refusal.reason
    assert solver.range(tag=22)[0].method == "least_squares"
    assert solver.set_method("robust_tracker").successful


def test_every_arrival_of_a_blink_gets_a_verdict(solver):
    reference, *others = ANCHORS
    way = {anchor: math.dist(at, PLACE) for anchor, at in ANCHORS.items()}
    blink = TdoaArray(
        tag_id=23,
        differences=[
            TdoaDifference(
                anchor_id=anchor, reference_anchor_id=reference, range_difference=way[anchor] - way[reference]
            )
            for anchor in others
        ],
    )
    blink.differences[1].range_difference = math.nan
    blink.differences.append(TdoaDifference(anchor_id=99, reference_anchor_id=reference, range_difference=1.0))
    for _ in range(3):
        pose, verdicts = solver.ask(blink)
        assert sorted(verdicts) == [*ANCHORS, 99]
        assert {verdict.source for verdict in verdicts.values()} == {MeasurementVerdict.TDOA}
        assert verdicts[others[1]].reason == MeasurementVerdict.INVALID
        assert verdicts[99].reason == MeasurementVerdict.UNKNOWN_SENSOR
        if pose.status == UwbPose.OK:
            assert pose.ranges_used == sum(verdict.accepted for verdict in verdicts.values())
    assert solver.observer.level("uwb_solver: callbacks") == 0
    assert solver.run.alive


def test_a_late_range_moves_the_position_less_on_a_link_that_the_classifier_calls_obstructed(solver):
    moved_m = {}
    for tag, los_probability in ((24, 0.02), (25, 0.98)):
        for _ in range(10):
            solver.range(tag)
        solver.tell(tag, 1, los_probability)
        before, _ = solver.range(tag)  # its answer shows that the judgement before it has been heard
        after, verdicts = solver.range(tag, late={1: 0.35})
        assert verdicts[1].accepted
        at, was = after.pose.pose.position, before.pose.pose.position
        moved_m[los_probability] = math.dist((at.x, at.y), (was.x, was.y))
    assert 1.5 * moved_m[0.02] < moved_m[0.98]


def test_a_repeated_stamp_is_answered_as_a_duplicate(solver):
    solver.range(tag=26)
    repeated = UwbRangeArray(tag_id=26, ranges=[UwbRange(anchor_id=1, range=9.0, range_variance=0.01)])
    repeated.header.stamp = solver.poses.messages[-1].header.stamp
    before = len(solver.verdicts)
    solver._publishers[UwbRangeArray].publish(repeated)
    solver.observer.wait_for(lambda: len(solver.verdicts) > before)
    (verdict,) = solver.verdicts.messages[-1].verdicts
    assert (verdict.accepted, verdict.reason) == (False, MeasurementVerdict.DUPLICATE)


# Anchors on a vehicle.


@pytest.fixture
def mixed_site(tmp_path) -> Path:
    """Anchors 1 and 2 hang in the mine; a shuttle car carries 3 to 6 and ranges to whoever is round it."""
    site = write_site(tmp_path / "site", [], [])
    content = yaml.safe_load((site / "site.yaml").read_text())
    corners = [(3.0, 1.25, 1.5), (3.0, -1.25, 2.0), (-3.0, 1.25, 2.0), (-3.0, -1.25, 1.5)]
    content["anchors"] = content["anchors"][:2] + [
        {"id": 3 + number, "position_m": list(corner)} for number, corner in enumerate(corners)
    ]
    content["vehicles"] = [
        {"id": "shuttle", "size_m": [6.0, 2.5, 2.0], "position_m": [40.0, 30.0, 0.0], "anchors": [3, 4, 5, 6]}
    ]
    (site / "site.yaml").write_text(yaml.safe_dump(content))
    return site


def test_positions_in_a_vehicle_s_frame_are_solved_with_its_own_anchors(mixed_site, domain, observer, tmp_path):
    maps = observer.listen(AnchorMap, "uwb/anchors", LATCHED)
    command = node_command(MODULE, {"site": mixed_site, "frame": "shuttle"})
    with running(command, domain, tmp_path / "log") as run:
        solver = Solver(run, observer)
        observer.wait_for(lambda: maps.messages, what="the anchor map")
        carried = {anchor.anchor_id: anchor.position for anchor in maps.messages[-1].anchors}
        assert sorted(carried) == [3, 4, 5, 6]
        assert maps.messages[-1].header.frame_id == "shuttle/base_link"
        place = (1.0, 4.0, TAG_HEIGHT_M)
        ranges = [
            UwbRange(
                anchor_id=anchor, range=math.dist((at.x, at.y, at.z), place), range_variance=0.01, los_probability=1.0
            )
            for anchor, at in carried.items()
        ]
        ranges.append(UwbRange(anchor_id=1, range=12.0, range_variance=0.01, los_probability=1.0))
        pose, verdicts = solver.ask(UwbRangeArray(tag_id=31, ranges=ranges))
        assert pose.header.frame_id == solver.verdicts.messages[-1].header.frame_id == "shuttle/base_link"
        assert math.dist((pose.pose.pose.position.x, pose.pose.pose.position.y), place[:2]) < 0.05
        assert verdicts[1].reason == MeasurementVerdict.UNKNOWN_SENSOR
        assert all(verdicts[anchor].accepted for anchor in carried)


def test_a_frame_that_the_site_does_not_have_is_refused_with_those_it_has(mixed_site, domain, tmp_path):
    with running(node_command(MODULE, {"site": mixed_site, "frame": "loader"}), domain, tmp_path / "log") as run:
        assert run.ends() == 2
        (line,) = run.output.splitlines()
    assert "frame: 'loader'" in line
    assert "allowed: map, shuttle" in line


def test_positions_in_a_vehicle_s_frame_are_no_epochs_of_the_map(tmp_path, domain, observer):
    """Where a tag is beside a vehicle says nothing of where it is in the mine: nobody tells where the vehicle is."""
    site = write_site(tmp_path / "site", [], [person("walker", 17)])
    epochs = observer.listen(Epoch, "sync/epochs")
    poses = observer.node.create_publisher(UwbPose, "uwb/pose", 10)
    with running(node_command("mine_loc_fusion.nodes.synchroniser", {"site": site}), domain, tmp_path / "log"):
        observer.wait_for(poses.get_subscription_count, what="the node")
        observer.wait_for(lambda: observer.level("synchroniser: callbacks") == 0, what="an active node")
        for seq, frame in enumerate(("loader/base_link", "map"), start=1):
            pose = UwbPose(tag_id=17, seq=seq, status=UwbPose.OK)
            pose.header.stamp, pose.header.frame_id = to_time(time.time_ns()), frame
            poses.publish(pose)
        observer.wait_for(lambda: len(epochs), what="an epoch")
        observer.wait_for(lambda: observer.value("synchroniser: frames", "poses") == 1, what="the counter")
    assert [pose.seq for epoch in epochs.messages for pose in epoch.uwb_poses] == [2]
