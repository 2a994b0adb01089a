"""Epochs and estimates between ROS messages and the pure types."""

import math

import numpy as np
from geometry_msgs.msg import PoseWithCovariance, TransformStamped, Vector3
from mine_loc_interfaces import msg

from mine_loc_core.nodes.conversions import to_point, to_time
from mine_loc_core.stamps import to_stamp_ns
from mine_loc_core.verdicts import Reason, Source, Verdict
from mine_loc_fusion.estimate import (
    Array,
    EpochInputs,
    Estimate,
    PlaceFix,
    PositionFix,
    StepFix,
    VelocityChange,
    ce95_m,
)
from mine_loc_fusion.mode import Mode
from mine_loc_uwb.nodes.solver_messages import measured_arrivals, measured_ranges
from mine_loc_uwb.range_intake import RangeIntake

_UNKNOWN_VARIANCE = 1e6
_HEIGHT_VARIANCE_M2 = 0.3**2


def to_inputs(
    epoch: msg.Epoch, intake: RangeIntake, height_m: float | None, arrival_variance_m2: float
) -> tuple[EpochInputs, tuple[Verdict, ...]]:
    """What the estimator uses of an epoch, and verdicts on the ranges that are none.

    Poses without a position stay out (their verdict is the solver's), and turns that match no marker. `height_m`: of
    the tag, None = solve for it; `arrival_variance_m2`: of arrivals of a blink whose own is unknown.
    """
    stamp_ns = to_stamp_ns(epoch.header.stamp)
    for state in epoch.link_states:
        if state.method != msg.LinkState.METHOD_POWER_RULE:  # the range brings what its powers say
            intake.link_state(state.tag_id, state.anchor_id, stamp_ns, state.los_probability)
    rounds = [(array.tag_id, measured_ranges(array), Source.RANGE) for array in epoch.ranges]
    rounds += [(array.tag_id, measured_arrivals(array, arrival_variance_m2), Source.TDOA) for array in epoch.tdoa]
    taken, refused = [], []
    for tag_id, items, source in rounds if intake.anchors else ():
        measurements, reasons = intake.take(tag_id, stamp_ns, items, height_m, source)
        taken.append(measurements)
        refused += [
            Verdict(source, item.anchor_id, reason)
            for item, reason in zip(items, reasons, strict=True)
            if reason is not Reason.ACCEPTED
        ]
    los = los_fraction(epoch)
    inputs = EpochInputs(
        stamp_ns,
        positions=tuple(_to_position(pose, los) for pose in epoch.uwb_poses if pose.status == msg.UwbPose.OK),
        steps=tuple(
            StepFix(step.length, step.length_variance, step.heading, step.heading_variance, step.interval)
            for step in epoch.steps
        ),
        ranges=tuple(measurements for measurements in taken if len(measurements)),
        velocity_changes=tuple(_to_change(change) for change in epoch.velocity_changes),
        places=tuple(_to_place(fix) for fix in epoch.landmark_fixes if fix.verdict == msg.LandmarkFix.MATCHED),
    )
    return inputs, tuple(refused)


def _to_position(pose: msg.UwbPose, los: float) -> PositionFix:
    return PositionFix(*to_place(pose.pose), los)


def to_place(pose: PoseWithCovariance) -> tuple[Array, Array]:
    """Horizontal position (2,) and its covariance (2, 2)."""
    position = pose.pose.position
    covariance: Array = np.asarray(pose.covariance).reshape(6, 6)[:2, :2].copy()
    return np.array([position.x, position.y]), covariance


def _to_place(fix: msg.LandmarkFix) -> PlaceFix:
    covariance = np.asarray(fix.position_covariance).reshape(3, 3)
    return PlaceFix(Source.LANDMARK, np.array([fix.position.x, fix.position.y]), covariance[:2, :2].copy())


def _to_change(change: msg.VelocityChange) -> VelocityChange:
    return VelocityChange(np.array([change.change.x, change.change.y, change.change.z]), change.interval)


def to_region(region: msg.CoarseRegion) -> PlaceFix:
    """A coarse region as a place."""
    covariance = np.asarray(region.covariance).reshape(2, 2).copy()
    return PlaceFix(Source.REGION, np.array([region.center.x, region.center.y]), covariance)


def los_fraction(epoch: msg.Epoch) -> float:
    """Mean line-of-sight probability of the epoch's links; NaN = not judged."""
    judged = [state.los_probability for state in epoch.link_states]
    judged += [item.los_probability for array in epoch.ranges for item in array.ranges]
    judged = [value for value in judged if 0.0 <= value <= 1.0]
    return float(np.mean(judged)) if judged else math.nan


def to_person_pose(
    name: str, tag_id: int, estimate: Estimate, height_m: float, los: float, mode: Mode
) -> msg.PersonPose:
    """One person's entry; yaw is that of motion when the person moves, else unknown."""
    message = msg.PersonPose(
        person=name,
        tag_id=tag_id,
        stamp=to_time(estimate.stamp_ns),
        pose=to_pose(estimate, height_m),
        velocity=Vector3(x=float(estimate.velocity_ms[0]), y=float(estimate.velocity_ms[1])),
        horizontal_ce95=ce95_m(estimate.covariance[:2, :2]),
        mode=int(mode),
        since_uwb=estimate.since_uwb_s,
        since_step=estimate.since_step_s,
        los_fraction=los,
    )
    P = estimate.covariance
    message.velocity_covariance = [P[2, 2], P[2, 3], 0.0, P[3, 2], P[3, 3], 0.0, 0.0, 0.0, _HEIGHT_VARIANCE_M2]
    return message


def to_pose(estimate: Estimate, height_m: float) -> PoseWithCovariance:
    """Pose with covariance; orientation is that of motion, with the variance its speed allows."""
    speed = float(np.hypot(*estimate.velocity_ms))
    yaw = math.atan2(estimate.velocity_ms[1], estimate.velocity_ms[0])
    velocity_variance = float(np.trace(estimate.covariance[2:, 2:])) / 2.0
    yaw_variance = min(velocity_variance / max(speed, 1e-3) ** 2, math.pi**2)
    pose = PoseWithCovariance()
    pose.pose.position = to_point((*estimate.position_m, height_m))
    pose.pose.orientation.z = math.sin(yaw / 2.0)
    pose.pose.orientation.w = math.cos(yaw / 2.0)
    covariance = np.zeros((6, 6))
    covariance[:2, :2] = estimate.covariance[:2, :2]
    covariance[2, 2] = _HEIGHT_VARIANCE_M2
    covariance[3, 3] = covariance[4, 4] = _UNKNOWN_VARIANCE
    covariance[5, 5] = yaw_variance
    pose.covariance = covariance.ravel()
    return pose


def to_transform(parent: str, child: str, stamp_ns: int, x: float, y: float, z: float, yaw: float) -> TransformStamped:
    """A transform with rotation about z only."""
    transform = TransformStamped(child_frame_id=child)
    transform.header.frame_id = parent
    transform.header.stamp = to_time(stamp_ns)
    transform.transform.translation = Vector3(x=x, y=y, z=z)
    transform.transform.rotation.z = math.sin(yaw / 2.0)
    transform.transform.rotation.w = math.cos(yaw / 2.0)
    return transform
