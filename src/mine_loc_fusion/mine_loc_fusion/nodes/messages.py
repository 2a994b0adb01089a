"""Epochs and estimates between ROS messages and the pure types."""

import math

import numpy as np
from geometry_msgs.msg import PoseWithCovariance, TransformStamped, Vector3
from mine_loc_interfaces import msg

from mine_loc_core.nodes.conversions import to_point, to_stamp_ns, to_time
from mine_loc_fusion.estimate import EpochInputs, Estimate, PositionFix, StepFix
from mine_loc_fusion.pose_filter import ce95_m

_UNKNOWN_VARIANCE = 1e6
_HEIGHT_VARIANCE_M2 = 0.3**2


def to_inputs(epoch: msg.Epoch) -> EpochInputs:
    """What the estimator uses of an epoch; poses without a position stay out (their verdict is the solver's)."""
    return EpochInputs(
        to_stamp_ns(epoch.header.stamp),
        tuple(_to_position(pose) for pose in epoch.uwb_poses if pose.status == msg.UwbPose.OK),
        tuple(
            StepFix(step.length, step.length_variance, step.heading, step.heading_variance, step.interval)
            for step in epoch.steps
        ),
    )


def _to_position(pose: msg.UwbPose) -> PositionFix:
    position = pose.pose.pose.position
    covariance = np.asarray(pose.pose.covariance).reshape(6, 6)
    return PositionFix(np.array([position.x, position.y]), covariance[:2, :2].copy())


def los_fraction(epoch: msg.Epoch) -> float:
    """Mean line-of-sight probability of the epoch's links; NaN = not judged."""
    judged = [state.los_probability for state in epoch.link_states]
    judged += [item.los_probability for array in epoch.ranges for item in array.ranges]
    judged = [value for value in judged if not math.isnan(value)]
    return float(np.mean(judged)) if judged else math.nan


def to_person_pose(name: str, tag_id: int, estimate: Estimate, height_m: float, los: float) -> msg.PersonPose:
    """One person's entry; yaw is that of motion when the person moves, else unknown."""
    message = msg.PersonPose(
        person=name,
        tag_id=tag_id,
        stamp=to_time(estimate.stamp_ns),
        pose=to_pose(estimate, height_m),
        velocity=Vector3(x=float(estimate.velocity_ms[0]), y=float(estimate.velocity_ms[1])),
        horizontal_ce95=ce95_m(estimate.covariance[:2, :2]),
        mode=int(estimate.mode),
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
