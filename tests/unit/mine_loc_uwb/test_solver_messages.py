"""Messages to measurements and fixes to messages."""

import math

import numpy as np
import pytest
from mine_loc_interfaces.msg import TdoaArray, TdoaDifference, UwbPose, UwbRange, UwbRangeArray

from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.stamps import to_stamp_ns
from mine_loc_uwb.fix import Fix, FixStatus, no_fix
from mine_loc_uwb.nodes.solver_messages import measured_arrivals, measured_ranges, to_pose
from mine_loc_uwb.range_intake import MeasuredRange


def test_a_round_s_ranges_keep_their_order_and_what_is_known_of_them():
    array = UwbRangeArray(
        ranges=[
            UwbRange(
                anchor_id=2**64 - 1,
                range=5.25,
                range_raw=6.0,
                range_variance=0.04,
                stamp_offset_ns=-1_500_000,
                los_probability=0.25,
                los_state=UwbRange.AMBIGUOUS,
                receive_power=-80.5,
            ),
            UwbRange(anchor_id=3, range=math.nan, receive_power=math.nan),  # los_state and probability never set
        ]
    )
    first, second = measured_ranges(array)
    assert first == MeasuredRange(2**64 - 1, 5.25, 0.04, -1_500_000, 0.25, -80.5)
    assert second.anchor_id == 3
    assert math.isnan(second.range_m)
    assert math.isnan(second.los_probability)


def test_the_arrivals_of_a_blink_begin_with_the_reference_at_nothing():
    differences = [
        TdoaDifference(anchor_id=anchor, reference_anchor_id=1, range_difference=difference, receive_power=-70.0)
        for anchor, difference in ((2, -3.5), (3, 4.0))
    ]
    arrivals = measured_arrivals(TdoaArray(reference_receive_power=-60.0, differences=differences), 0.0225)
    assert [(item.anchor_id, item.range_m, item.receive_power_dbm) for item in arrivals] == [
        (1, 0.0, -60.0),
        (2, -3.5, -70.0),
        (3, 4.0, -70.0),
    ]
    assert {item.variance_m2 for item in arrivals} == {0.0225}
    assert all(math.isnan(item.los_probability) for item in arrivals)


def test_a_difference_to_another_reference_is_no_arrival_and_a_variance_of_its_own_counts():
    array = TdoaArray()
    array.differences = [
        TdoaDifference(anchor_id=2, reference_anchor_id=1, range_difference=-3.5, variance=0.5),
        TdoaDifference(anchor_id=3, reference_anchor_id=2, range_difference=4.0),
    ]
    _, second, third = measured_arrivals(array, 0.0225)
    assert (second.variance_m2, third.variance_m2) == (0.5, 0.0225)
    assert math.isnan(third.range_m)


def test_a_blink_that_one_anchor_heard_has_no_arrivals():
    assert measured_arrivals(TdoaArray(), 0.01) == []


def array() -> UwbRangeArray:
    array = UwbRangeArray(tag_id=17, seq=9)
    array.header.stamp = to_time(123_456_789_012)
    return array


def test_a_fix_becomes_a_pose_of_the_round_s_instant_whose_orientation_is_unknown():
    covariance = np.array([[0.04, 0.01, 0.0], [0.01, 0.09, 0.0], [0.0, 0.0, 0.0]])
    fix = Fix(FixStatus.OK, np.array([1.0, 2.0, 1.2]), covariance, 2, 5, 0.03, 1.4)
    pose = to_pose(fix, array(), "shuttle/base_link", "weighted_lm", 2)
    assert to_stamp_ns(pose.header.stamp) == 123_456_789_012
    assert (pose.header.frame_id, pose.tag_id, pose.seq, pose.method) == ("shuttle/base_link", 17, 9, "weighted_lm")
    assert (pose.status, pose.dimensions, pose.ranges_used, pose.ranges_rejected) == (UwbPose.OK, 2, 5, 2)
    assert (pose.residual_rms, pose.gdop) == (pytest.approx(0.03), pytest.approx(1.4))
    at = pose.pose.pose.position
    assert (at.x, at.y, at.z) == (1.0, 2.0, 1.2)
    block = np.reshape(pose.pose.covariance, (6, 6))
    assert block[:3, :3].tolist() == covariance.tolist()
    assert np.diag(block)[3:].tolist() == [-1.0] * 3
    assert block.sum() == pytest.approx(covariance.sum() - 3.0)


def test_no_fix_becomes_a_pose_without_a_position_that_says_so():
    pose = to_pose(no_fix(FixStatus.DEGENERATE, 2), array(), "map", "least_squares", 300)
    assert pose.status == UwbPose.DEGENERATE
    assert math.isnan(pose.pose.pose.position.x)
    assert (pose.ranges_used, pose.ranges_rejected) == (0, 255)


@pytest.mark.parametrize("status", FixStatus)
def test_statuses_are_the_constants_of_the_message(status):
    assert getattr(UwbPose, "STATUS_UNKNOWN" if status is FixStatus.UNKNOWN else status.name) == status
