"""Messages to what the solvers take, and their fixes to messages."""

import math

from geometry_msgs.msg import PoseWithCovariance
from mine_loc_interfaces.msg import TdoaArray, UwbPose, UwbRange, UwbRangeArray

from mine_loc_core.nodes.conversions import to_point
from mine_loc_uwb.fix import Fix
from mine_loc_uwb.range_intake import MeasuredRange


def measured_ranges(array: UwbRangeArray) -> list[MeasuredRange]:
    """The ranges of a round."""
    return [
        MeasuredRange(
            item.anchor_id,
            item.range,
            item.range_variance,
            item.stamp_offset_ns,
            math.nan if item.los_state == UwbRange.LOS_UNKNOWN else item.los_probability,
            item.receive_power,
        )
        for item in array.ranges
    ]


def measured_arrivals(array: TdoaArray, variance_m2: float) -> list[MeasuredRange]:
    """The arrivals of a blink: the reference anchor's at 0, then the others' differences to it.

    `variance_m2` is that of arrivals whose own is unknown. A difference to another reference is no arrival: NaN.
    """
    if not array.differences:
        return []
    reference_id = array.differences[0].reference_anchor_id
    reference = MeasuredRange(reference_id, 0.0, variance_m2, receive_power_dbm=array.reference_receive_power)
    return [reference] + [
        MeasuredRange(
            item.anchor_id,
            item.range_difference if item.reference_anchor_id == reference_id else math.nan,
            item.variance or variance_m2,
            receive_power_dbm=item.receive_power,
        )
        for item in array.differences
        if item.anchor_id != reference_id
    ]


def to_pose(fix: Fix, array: UwbRangeArray | TdoaArray, frame_id: str, method: str, rejected: int) -> UwbPose:
    """The position of the tag of a round or blink; orientation is unknown."""
    pose = PoseWithCovariance()
    pose.pose.position = to_point(fix.position_m)
    pose.pose.orientation.w = 1.0
    covariance = [0.0] * 36
    for row in range(3):
        for column in range(3):
            covariance[6 * row + column] = float(fix.covariance_m2[row, column])
    for index in (21, 28, 35):
        covariance[index] = -1.0
    pose.covariance = covariance
    message = UwbPose(
        tag_id=array.tag_id,
        seq=array.seq,
        pose=pose,
        method=method,
        dimensions=fix.dimensions,
        ranges_used=min(fix.ranges_used, 255),
        ranges_rejected=min(rejected, 255),
        residual_rms=fix.residual_rms_m,
        gdop=fix.gdop,
        status=int(fix.status),
    )
    message.header.stamp = array.header.stamp
    message.header.frame_id = frame_id
    return message
