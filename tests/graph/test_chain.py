"""Bytes on two serial lines become poses: every topic of the chain, its stamps, frames, covariances and verdicts."""

import itertools
import math
import os
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseWithCovarianceStamped
from graph.live_graph import LiveGraph, live_graph
from graph.observer import Heard
from graph.walker import RADIUS_M, SPEED_M_S, VISITOR_TAG, frame, position_m, ranging
from mine_loc_interfaces.msg import (
    Activity,
    Epoch,
    FusionHealth,
    MeasurementVerdict,
    MeasurementVerdictArray,
    PersonPose,
    PersonPoseArray,
    Step,
    UwbPose,
    UwbRangeArray,
)
from mine_loc_interfaces.srv import Reset, SetAnchorEnabled
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, MagneticField
from tf2_msgs.msg import TFMessage

from mine_loc_core.nodes.qos import STREAM
from mine_loc_core.stamps import to_stamp_ns
from mine_loc_uwb.ranging import Range

pytestmark = pytest.mark.graph

TOPICS: dict[str, tuple[type, str, Any]] = {
    "ranges": (UwbRangeArray, "uwb/ranges", 100),
    "uwb_pose": (UwbPose, "uwb/pose", 100),
    "uwb_verdicts": (MeasurementVerdictArray, "uwb/verdicts", 100),
    "imu": (Imu, "walker/imu/data", STREAM),
    "mag": (MagneticField, "walker/imu/mag", STREAM),
    "steps": (Step, "pdr/steps", 100),
    "activity": (Activity, "pdr/activity", 100),
    "odometry": (Odometry, "walker/odometry", 100),
    "epochs": (Epoch, "sync/epochs", 100),
    "poses": (PersonPoseArray, "fused/poses", 100),
    "pose": (PoseWithCovarianceStamped, "people/walker/pose", 100),
    "tf": (TFMessage, "/tf", 100),
    "verdicts": (MeasurementVerdictArray, "fused/verdicts", 100),
    "health": (FusionHealth, "fused/health", 100),
    "diagnostics": (DiagnosticArray, "/diagnostics", 100),
}


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveGraph]:
    with live_graph(tmp_path_factory.mktemp("chain")) as running_graph:
        yield running_graph


@pytest.fixture(scope="module")
def heard(graph: LiveGraph) -> dict[str, Heard]:
    """Everything the graph said until the walker was tracked with steps for a while."""
    topics = {name: graph.observer.listen(*what) for name, what in TOPICS.items()}
    poses = topics["poses"].messages

    def tracked() -> bool:
        modes = [item.mode for array in poses[-40:] for item in array.people]
        if modes.count(PersonPose.UWB_PDR) != 40:
            return False
        transforms = [t for message in topics["tf"].messages for t in message.transforms]
        odometry = [to_stamp_ns(t.header.stamp) for t in transforms if t.child_frame_id == "walker/base_link"]
        return min(odometry, default=math.inf) <= to_stamp_ns(poses[-40].header.stamp)

    graph.observer.wait_for(tracked, 40.0, "four seconds in mode UWB_PDR")
    return topics


def stamps_ns(messages: list[Any]) -> list[int]:
    return [to_stamp_ns(message.header.stamp) for message in messages]


@pytest.mark.parametrize("topic", TOPICS)
def test_every_topic_of_the_chain_speaks(heard, topic):
    assert heard[topic].messages


def test_every_node_reports_itself_well(graph, heard):
    del heard
    graph.observer.wait_for(
        lambda: (
            {name.split(":")[0] for name in graph.observer.status}
            >= {"dwm1000_driver_gate", "uwb_solver", "walker/n100_driver", "pdr", "synchroniser", "fusion"}
        )
    )
    faulty = {name: status.message for name, status in graph.observer.status.items() if status.level != b"\x00"}
    assert faulty == {}


def test_fused_positions_are_where_the_walker_is(graph, heard):
    errors_m = [
        math.dist(
            (item.pose.pose.position.x, item.pose.pose.position.y), graph.walker.position_at(to_stamp_ns(item.stamp))
        )
        for array in heard["poses"].messages[-40:]
        for item in array.people
    ]
    assert np.median(errors_m) < 0.15
    assert max(errors_m) < 0.5


@pytest.mark.parametrize("topic", ["ranges", "imu"])
def test_stamps_are_instants_of_measurement_though_bytes_come_late(graph, heard, topic):
    """Rounds that reach the line 60 ms late are stamped as if they had not."""
    messages = heard[topic].messages[-50:]
    if topic == "ranges":
        true_ns = [graph.walker.stamp_ns(message.device_ticks) for message in messages]
    else:
        true_ns = [
            graph.walker.start_ns + round((s - graph.walker.start_ns) / 1e7) * 10**7 for s in stamps_ns(messages)
        ]
    errors_ms = (np.array(stamps_ns(messages)) - np.array(true_ns)) / 1e6
    assert abs(errors_ms).max() < 20.0
    assert np.ptp(errors_ms) < 10.0


@pytest.mark.parametrize("topic", ["ranges", "uwb_pose", "imu", "mag", "odometry", "pose", "verdicts"])
def test_stamps_of_an_output_never_go_back(heard, topic):
    stamps = stamps_ns(heard[topic].messages)
    if topic == "verdicts":  # what comes late is judged at its own instant
        late = set(stamps_ns([epoch for epoch in heard["epochs"].messages if epoch.late]))
        stamps = [stamp_ns for stamp_ns in stamps if stamp_ns not in late]
    assert stamps == sorted(stamps)
    assert 0 not in stamps


def test_fused_stamps_of_a_person_never_go_back(heard):
    stamps = [to_stamp_ns(item.stamp) for array in heard["poses"].messages for item in array.people]
    assert stamps == sorted(stamps)


def test_epochs_that_are_not_late_are_in_order_and_use_each_round_once(heard):
    epochs = heard["epochs"].messages
    prompt = stamps_ns([epoch for epoch in epochs if not epoch.late])
    assert all(later > earlier for earlier, later in itertools.pairwise(prompt))
    rounds = [item.seq for epoch in epochs for item in epoch.ranges]
    assert len(rounds) == len(set(rounds))
    assert [epoch.seq for epoch in epochs] == sorted(epoch.seq for epoch in epochs)


def test_who_walks_a_circle_is_said_to_turn_by_what_four_seconds_of_it_are(heard):
    last = heard["activity"].messages[-1]
    assert (last.person, last.activity, last.window) == ("walker", Activity.TURNING, 4.0)
    assert last.turn_angle == pytest.approx(4.0 * SPEED_M_S / RADIUS_M, abs=0.1)
    assert 0.5 < last.probability <= 1.0


def test_frames_and_ids_follow_the_conventions(heard):
    last = {name: topic.messages[-1] for name, topic in heard.items()}
    assert last["ranges"].header.frame_id == "uwb_tag_link"
    assert last["imu"].header.frame_id == last["mag"].header.frame_id == "walker/imu_link"
    assert last["odometry"].header.frame_id == last["steps"].header.frame_id == "walker/odom"
    assert last["odometry"].child_frame_id == "walker/base_link"
    for topic in ("uwb_pose", "uwb_verdicts", "epochs", "poses", "pose", "verdicts", "health"):
        assert last[topic].header.frame_id == "map"


def test_covariances_are_positive_semi_definite_and_nothing_is_nan(heard):
    blocks = [np.reshape(m.pose.covariance, (6, 6)) for name in ("pose", "odometry") for m in heard[name].messages]
    blocks += [np.reshape(m.pose.covariance, (6, 6)) for a in heard["poses"].messages for m in a.people]
    blocks += [np.reshape(m.velocity_covariance, (3, 3)) for a in heard["poses"].messages for m in a.people]
    blocks += [np.reshape(m.pose.covariance, (6, 6))[:3, :3] for m in heard["uwb_pose"].messages]
    for block in blocks:
        assert np.isfinite(block).all()
        assert np.allclose(block, block.T)
        assert np.linalg.eigvalsh(block)[0] > -1e-9
    for item in (person for array in heard["poses"].messages for person in array.people):
        body = item.pose.pose
        values = [body.position.x, body.position.y, body.position.z, body.orientation.z, body.orientation.w]
        assert np.isfinite([*values, item.velocity.x, item.velocity.y, item.horizontal_ce95]).all()


def test_map_odom_base_link_ends_at_the_fused_pose(heard):
    """REP 105: at the instant of a fused pose, map → odom (published there) after odom → base_link (the last before).

    Dead reckoning says where a step ended up to 0.4 s late, so the chain may be one step off and no more.
    """
    transforms = [item for message in heard["tf"].messages for item in message.transforms]
    map_odom = {to_stamp_ns(t.header.stamp): t for t in transforms if t.child_frame_id == "walker/odom"}
    odom_base = [(to_stamp_ns(t.header.stamp), t) for t in transforms if t.child_frame_id == "walker/base_link"]
    assert {t.header.frame_id for t in map_odom.values()} == {"map"}
    fused = heard["pose"].messages[-40:-5]  # of the last ones the transforms may still be on their way
    errors_m = []
    for pose in fused:
        stamp_ns = to_stamp_ns(pose.header.stamp)
        outer = map_odom[stamp_ns].transform
        before = [t for s, t in odom_base if s <= stamp_ns]
        assert before, "no odom → base_link before the fused pose"
        inner = before[-1].transform
        yaw = 2.0 * math.atan2(outer.rotation.z, outer.rotation.w)
        x = outer.translation.x + math.cos(yaw) * inner.translation.x - math.sin(yaw) * inner.translation.y
        y = outer.translation.y + math.sin(yaw) * inner.translation.x + math.cos(yaw) * inner.translation.y
        errors_m.append(math.dist((x, y), (pose.pose.pose.position.x, pose.pose.pose.position.y)))
    assert max(errors_m) < 0.8
    assert np.median(errors_m) < 0.1


# Measurements that must not be used, told by the visitor's tag, which nothing else drives.


def visit(graph: LiveGraph, topics: dict[str, Heard], ranges: list[Range]) -> Any:
    """Send a round that the visitor makes now; its verdicts by anchor and the fix it gave."""
    now_s = time.monotonic() - graph.walker.start_s
    message = replace(ranging(now_s, 2000 + round(now_s * 10.0), VISITOR_TAG), ranges=tuple(ranges))
    fixes, verdicts = topics["uwb_pose"].messages, topics["uwb_verdicts"].messages
    graph.walker.uwb.write(frame(message, 0))
    ours = lambda messages: [m for m in messages if m.tag_id == VISITOR_TAG]  # noqa: E731
    fixes_before, verdicts_before = len(ours(fixes)), len(ours(verdicts))
    graph.observer.wait_for(lambda: len(ours(fixes)) > fixes_before and len(ours(verdicts)) > verdicts_before)
    return ours(fixes)[-1], {v.sensor_id: v for v in ours(verdicts)[-1].verdicts}


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (Range(99, 5.0), MeasurementVerdict.UNKNOWN_SENSOR),
        (Range(5, math.nan), MeasurementVerdict.INVALID),
        (Range(5, 2_000.0), MeasurementVerdict.INVALID),
        (Range(5, -3.0), MeasurementVerdict.INVALID),
    ],
    ids=["unknown anchor", "NaN", "farther than any radio", "negative"],
)
def test_a_bad_range_is_named_and_the_fix_comes_from_the_others(graph, heard, bad, reason):
    good = [r for r in ranging(0.0, 0).ranges if r.anchor_id != 5]
    fix, verdicts = visit(graph, heard, [*good, bad])
    assert (verdicts[bad.anchor_id].accepted, verdicts[bad.anchor_id].reason) == (False, reason)
    assert all(verdicts[r.anchor_id].accepted for r in good)
    assert (fix.status, fix.ranges_used, fix.ranges_rejected) == (UwbPose.OK, 4, 1)
    assert math.dist((fix.pose.pose.position.x, fix.pose.pose.position.y), position_m(0.0)) < 0.05


def test_an_anchor_switched_off_is_left_out_until_switched_on(graph, heard):
    def switch(anchor: int, enabled: bool) -> Any:
        request = SetAnchorEnabled.Request(anchor_id=anchor, enabled=enabled)
        return graph.observer.call(SetAnchorEnabled, "/uwb_solver/set_anchor_enabled", request)

    ranges = list(ranging(0.0, 0).ranges)
    assert switch(2, enabled=False).success
    try:
        fix, verdicts = visit(graph, heard, ranges)
        assert verdicts[2].reason == MeasurementVerdict.DISABLED
        assert fix.ranges_used == 4
    finally:
        assert switch(2, enabled=True).success
    assert visit(graph, heard, ranges)[1][2].accepted
    refusal = switch(99, enabled=False)
    assert not refusal.success
    assert "99" in refusal.reason
    assert "[1, 2, 3, 4, 5]" in refusal.reason


def test_reset_of_the_fusion_answers_with_a_reason_and_the_output_goes_on(graph, heard):
    def reset(person: str) -> Any:
        return graph.observer.call(Reset, "/fusion/reset", Reset.Request(person=person))

    refusal = reset("nobody")
    assert not refusal.success
    assert "walker" in refusal.reason
    answer = reset("walker")
    assert answer.success
    assert "walker" in answer.reason
    heard_before = len(heard["pose"])
    graph.observer.wait_for(lambda: len(heard["pose"]) > heard_before + 5)


def test_nothing_good_is_lost_among_garbage_and_the_garbage_is_counted(graph, heard):
    decoder = "dwm1000_driver_gate: decoder"
    skipped_before = graph.observer.value(decoder, "skipped_bytes")
    first = 1000
    for number in range(first, first + 30):
        junk = os.urandom(40).replace(b"\x55", b"\x00")  # no start of a frame in it
        graph.walker.uwb.write(junk + frame(ranging(number * 0.1, number, VISITOR_TAG), number))
    wanted = list(range(first, first + 30))

    def seen() -> list[int]:
        return [m.seq for m in heard["ranges"].messages if m.tag_id == VISITOR_TAG and m.seq in wanted]

    graph.observer.wait_for(lambda: len(seen()) == 30, what="all good rounds")
    assert seen() == wanted
    graph.observer.wait_for(lambda: graph.observer.value(decoder, "skipped_bytes") >= skipped_before + 30 * 40)
