"""Epochs and regions from messages to what the estimators take."""

import math

import numpy as np
import pytest

pytest.importorskip("rclpy")

from geometry_msgs.msg import Vector3
from mine_loc_interfaces import msg

from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.site import Anchor
from mine_loc_core.stamps import NS_PER_S
from mine_loc_core.verdicts import Reason, Source
from mine_loc_fusion.nodes.messages import los_fraction, to_inputs, to_region
from mine_loc_uwb.range_intake import RangeIntake

NOW_NS = 1_760_000_000 * NS_PER_S + 7
TAG = 17


def intake(count=4):
    return RangeIntake(
        [Anchor(i, str(i), (10.0 * i, 5.0 * (i % 2), 2.4), 0.0, 0.0) for i in range(1, count + 1)], 300.0
    )


def epoch(**parts):
    message = msg.Epoch(person="walker", **parts)
    message.header.stamp = to_time(NOW_NS)
    return message


def rounds(*values, **what):
    ranges = [msg.UwbRange(anchor_id=i, range=v, range_variance=0.04, **what) for i, v in enumerate(values, 1)]
    return msg.UwbRangeArray(tag_id=TAG, ranges=ranges)


def link_state(anchor, los, method=msg.LinkState.METHOD_NETWORK):
    return msg.LinkState(tag_id=TAG, anchor_id=anchor, los_probability=los, method=method)


def inputs_of(message, subject=None, height_m=1.2):
    return to_inputs(message, subject or intake(), height_m, 0.0225)


def test_an_empty_epoch_is_one_of_its_instant():
    inputs, refused = inputs_of(epoch())
    assert inputs.stamp_ns == NOW_NS
    assert (inputs.positions, inputs.steps, inputs.ranges, inputs.places, refused) == ((), (), (), (), ())


def test_ranges_become_measurements_and_what_is_refused_gets_its_verdict():
    inputs, refused = inputs_of(epoch(ranges=[rounds(5.0, math.nan, 7.0)]))
    (measured,) = inputs.ranges
    assert measured.anchor_ids.tolist() == [1, 3]
    assert measured.range_m.tolist() == [5.0, 7.0]
    assert measured.variance_m2.tolist() == pytest.approx([0.04, 0.04])
    assert (measured.stamp_ns, measured.height_m, measured.shared_offset) == (NOW_NS, 1.2, False)
    assert [(v.source, v.sensor_id, v.reason) for v in refused] == [(Source.RANGE, 2, Reason.INVALID)]


def test_a_round_of_which_all_is_refused_is_no_measurement():
    inputs, refused = inputs_of(epoch(ranges=[msg.UwbRangeArray(tag_id=TAG, ranges=[msg.UwbRange(anchor_id=99)])]))
    assert inputs.ranges == ()
    assert [(v.sensor_id, v.reason) for v in refused] == [(99, Reason.UNKNOWN_SENSOR)]


def test_without_a_height_the_place_is_solved_in_space():
    (measured,) = inputs_of(epoch(ranges=[rounds(5.0, 6.0)]), height_m=None)[0].ranges
    assert measured.dimensions == 3


def test_a_site_without_anchors_has_nothing_to_say_of_ranges():
    inputs, refused = inputs_of(epoch(ranges=[rounds(5.0, 6.0)]), RangeIntake([], 300.0))
    assert (inputs.ranges, refused) == ((), ())


def test_a_blink_becomes_arrivals_that_share_an_offset_with_the_variance_that_is_told():
    differences = [
        msg.TdoaDifference(anchor_id=i, reference_anchor_id=1, range_difference=float(i)) for i in (2, 3, 99)
    ]
    inputs, refused = inputs_of(epoch(tdoa=[msg.TdoaArray(tag_id=TAG, differences=differences)]))
    (measured,) = inputs.ranges
    assert measured.shared_offset
    assert measured.anchor_ids.tolist() == [1, 2, 3]
    assert measured.range_m.tolist() == [0.0, 2.0, 3.0]
    assert measured.variance_m2.tolist() == pytest.approx([0.0225] * 3)
    assert [(v.source, v.sensor_id, v.reason) for v in refused] == [(Source.TDOA, 99, Reason.UNKNOWN_SENSOR)]


def test_the_classifier_s_judgement_reaches_the_range_and_the_power_rule_s_does_not():
    states = [link_state(1, 0.2), link_state(2, 0.2, msg.LinkState.METHOD_POWER_RULE)]
    message = epoch(ranges=[rounds(5.0, 6.0, los_probability=math.nan)], link_states=states)
    (measured,) = inputs_of(message)[0].ranges
    assert measured.los_probability.tolist() == [pytest.approx(0.2), pytest.approx(math.nan, nan_ok=True)]


def test_steps_keep_their_figures_and_their_order():
    steps = [
        msg.Step(length=0.75, length_variance=0.01, heading=0.5, heading_variance=0.02, interval=0.55),
        msg.Step(length=0.5, interval=math.nan),
    ]
    first, second = inputs_of(epoch(steps=steps))[0].steps
    found = (first.length_m, first.length_variance_m2, first.heading_rad, first.heading_variance_rad2, first.interval_s)
    assert found == pytest.approx((0.75, 0.01, 0.5, 0.02, 0.55))
    assert math.isnan(second.interval_s)


def test_changes_of_velocity_keep_their_figures_and_the_time_that_they_took():
    change = msg.VelocityChange(interval=0.1, change=Vector3(x=0.1, y=-0.2, z=0.3))
    (found,) = inputs_of(epoch(velocity_changes=[change]))[0].velocity_changes
    assert found.change_m_s.tolist() == [0.1, -0.2, 0.3]
    assert found.interval_s == pytest.approx(0.1)


def test_of_landmark_fixes_only_those_that_match_are_places():
    fixes = [
        msg.LandmarkFix(verdict=verdict, position_covariance=[0.3, 0.1, 9.0, 0.2, 0.4, 9.0, 9.0, 9.0, 9.0])
        for verdict in range(msg.LandmarkFix.ANGLE_NOT_ALLOWED + 1)
    ]
    for number, fix in enumerate(fixes):
        fix.position.x, fix.position.y, fix.position.z = float(number), 2.0, 3.0
    (place,) = inputs_of(epoch(landmark_fixes=fixes))[0].places
    assert place.source is Source.LANDMARK
    assert place.position_m.tolist() == [float(msg.LandmarkFix.MATCHED), 2.0]
    assert place.covariance_m2.tolist() == [[0.3, 0.1], [0.2, 0.4]]


def test_of_solved_positions_only_those_that_are_are_given_with_the_mean_of_the_links():
    poses = [msg.UwbPose(status=status) for status in range(msg.UwbPose.DIVERGED + 1)]
    for number, pose in enumerate(poses):
        pose.pose.pose.position.x = float(number)
        pose.pose.covariance[0], pose.pose.covariance[7] = 0.5, 0.25
    states = [link_state(1, 0.25), link_state(2, 0.75)]
    (position,) = inputs_of(epoch(uwb_poses=poses, link_states=states))[0].positions
    assert position.position_m.tolist() == [float(msg.UwbPose.OK), 0.0]
    assert position.covariance_m2.tolist() == [[0.5, 0.0], [0.0, 0.25]]
    assert position.los_probability == pytest.approx(0.5)


@pytest.mark.parametrize("odd", [math.nan, math.inf, -1.0, 1.5, 1e30])
def test_what_is_no_probability_is_not_counted_among_the_judged(odd):
    assert los_fraction(epoch(link_states=[link_state(1, 0.25), link_state(2, odd)])) == pytest.approx(0.25)
    assert math.isnan(los_fraction(epoch(link_states=[link_state(2, odd)])))


def test_a_region_is_a_place_of_its_own_kind():
    message = msg.CoarseRegion(covariance=[4.0, 1.0, 1.0, 9.0])
    message.center.x, message.center.y = 3.0, -4.0
    place = to_region(message)
    assert place.source is Source.REGION
    assert place.position_m.tolist() == [3.0, -4.0]
    assert np.array_equal(place.covariance_m2, [[4.0, 1.0], [1.0, 9.0]])
