"""Pedestrian dead reckoning (paper B, section 2): samples of a waist-worn IMU to steps and a drifting pose.

The odom frame has its origin and its x axis where the person stood and faced at the start (REP 105); the papers' angle
from north does not occur here: x += L cos θ, y += L sin θ with θ counter-clockwise.
"""

import math
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mine_loc_core import quaternion
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S, to_ns, to_s
from mine_loc_pdr.attitude import (
    STANDARD_GRAVITY_M_S2,
    AttitudeFilter,
    Quaternion,
    Vector3,
    rotated,
    turned_about_up,
)
from mine_loc_pdr.drift import BIAS, HEADING, DriftModel, X, Y
from mine_loc_pdr.magnetic_heading import MagneticHeading
from mine_loc_pdr.mounting import FrontEstimate, FrontFinder, forward_push
from mine_loc_pdr.rest import RestDetector
from mine_loc_pdr.step_frames import LONGEST_BRIDGED_NS
from mine_loc_pdr.steps import LONGEST_INTERVAL_NS, SLOWEST_STEP_S, PeakStepDetector, Step, StepDetector
from mine_loc_pdr.stride import STEP_TO_STEP_SD_M, StepLengthModel, common_variance_m2, vertical_swing
from mine_loc_pdr.velocity_changes import VelocityChange, VelocityChanges

INITIAL_SPAN_NS = 500 * NS_PER_MS  # of force averaged for the first horizon
LONGEST_DT_NS = 200 * NS_PER_MS  # beyond it the motion in between is a guess, and counted as a gap
CLOCK_JUMP_NS = NS_PER_S  # a step back by more is a new clock, not a late sample
MOTION_SPAN_NS = LONGEST_INTERVAL_NS + NS_PER_S  # a step is reported within a second
LARGEST_RATE_RAD_S = 100.0  # beyond the range of any such sensor, as is
LARGEST_FORCE_M_S2 = 1000.0
# Below the range of any gyro. No rate so fast repeats to the last bit, unless it is clipped.
SATURATION_RAD_S = 4.0
MISSED_STEP_SHARE = 0.05  # measured: recall 0.946 on people 1 to 7 of ipol_gait_lowerback
# Assumed: walking direction against the mean facing of the waist over one step.
DIRECTION_SD_RAD = math.radians(6.0)
# Up to the first strike of a walk one foot has gone a step's way, the other none, and the waist half of it.
FIRST_STEP_SHARE = 0.5
FIRST_SWING_S = 0.6  # that the waist rises and falls for with it
LOWEST_AFTER_STRIKE_NS = 150 * NS_PER_MS  # when both feet are on the ground


@dataclass(frozen=True, slots=True)
class ImuSample:
    """Angular rate and specific force in the IMU's axes (FLU by convention) at stamp_ns."""

    stamp_ns: int
    rate_rad_s: Vector3
    force_m_s2: Vector3


@dataclass(frozen=True, slots=True)
class FieldSample:
    """Magnetic field in tesla in the IMU's axes at stamp_ns."""

    stamp_ns: int
    field_t: Vector3


@dataclass(frozen=True, slots=True)
class StepEvent:
    """One step; heading is the direction of walking in odom, stamp_ns the heel strike."""

    stamp_ns: int
    count: int
    interval_s: float | None  # None = first after standing
    length_m: float
    length_variance_m2: float  # holds that it may be none at all
    heading_rad: float
    heading_variance_rad2: float
    x_m: float  # position after the step, in odom
    y_m: float
    confidence: float  # probability that this was a step


@dataclass(frozen=True, slots=True)
class OdometryPose:
    """Pose of base_link in odom; covariance (3, 3) of x (m), y (m), yaw (rad)."""

    stamp_ns: int
    x_m: float
    y_m: float
    yaw_rad: float
    covariance: NDArray[np.float64]


class PedestrianDeadReckoning:
    """Carries one person's track from step to step.

    `faults` counts what was not usable: not_finite, out_of_range, duplicate and backward samples are dropped;
    no_gravity puts the start off; gaps, clock_jumps and saturated rates are carried over with the covariance grown
    accordingly. Across a gap of up to LONGEST_BRIDGED_NS a walk goes on; a longer one ends it.
    """

    def __init__(
        self,
        stride: StepLengthModel,
        forward_imu: Vector3 = (1.0, 0.0, 0.0),
        detector: StepDetector | None = None,
    ) -> None:
        """`forward_imu`: the unit vector in the IMU's axes that points to the front of the body.

        `detector`: paper B's if none is given.
        """
        self._stride = stride
        self._forward_imu = forward_imu
        self._detector = detector or PeakStepDetector()
        self._rest = RestDetector()
        self._drift = DriftModel(stride.scale_variance)
        self._attitude: AttitudeFilter | None = None
        self._initial: list[ImuSample] = []
        self._last: ImuSample | None = None
        self._drift_ns = 0  # up to which the drift model has been carried
        self._motion: deque[tuple[int, Quaternion, Vector3]] = deque()  # stamp, odom←imu, specific force
        self._front = FrontFinder()
        self._step_heading_rad = 0.0
        self._intervals_s: tuple[float | None, float | None] = None, None  # of the two steps before
        self._x_m = self._y_m = self._way_m = 0.0
        self._changes = VelocityChanges()
        self.velocity_change: VelocityChange | None = None
        """That the last sample completed, if any."""
        self.magnetic = MagneticHeading()
        self.step_count = 0
        self.faults: Counter[str] = Counter()

    def push(self, sample: ImuSample) -> Sequence[StepEvent]:
        """Take the next sample and return the steps it completes, in order; bad samples are counted and dropped."""
        self.velocity_change = None
        if fault := _fault(sample):
            self.faults[fault] += 1
            return ()
        last, attitude = self._last, self._attitude
        if attitude is None or last is None:
            self._initialise(sample)
            return ()
        dt_ns = sample.stamp_ns - last.stamp_ns
        if not 0 < dt_ns <= LONGEST_BRIDGED_NS:
            self._irregular(sample, dt_ns)
            return ()
        if dt_ns > LONGEST_DT_NS:
            self._unseen("gaps", sample.stamp_ns, dt_ns)
        self._last = sample
        return self._advance(attitude, last, sample, to_s(dt_ns))

    def push_field(self, sample: FieldSample) -> None:
        """Take a sample of the magnetic field, which corrects the heading where it can be trusted.

        It is judged with the attitude at its stamp; one that comes before the attitude, or more than MOTION_SPAN_NS
        after it, is left out.
        """
        attitude = self._attitude
        if attitude is None or not all(map(math.isfinite, sample.field_t)):
            return
        orientation = next((q for stamp_ns, q, _ in reversed(self._motion) if stamp_ns <= sample.stamp_ns), None)
        if orientation is None:
            return
        field_odom_t = rotated(orientation, sample.field_t)
        field = self.magnetic.push(sample.stamp_ns, self._way_m, field_odom_t, attitude.heading_rad)
        if field is None:
            return
        self._carry_drift()
        learnt = self.magnetic.compare(field, self._drift)
        if learnt is not None:
            attitude.correct(*learnt)

    def rescale(self, scale: float, variance: float) -> None:
        """Make the steps from now on with another K."""
        self._stride = self._stride.scaled(scale, variance)
        self._drift.rescale(variance)

    def pose(self) -> OdometryPose | None:
        """The pose at the last sample, None before the horizon is found."""
        if self._attitude is None or self._last is None:
            return None
        self._carry_drift()
        index = [X, Y, HEADING]
        covariance = self._drift.covariance[np.ix_(index, index)]
        return OdometryPose(self._last.stamp_ns, self._x_m, self._y_m, self._attitude.heading_rad, covariance)

    @property
    def heading_rad(self) -> float | None:
        """Where the waist faces in odom at the last sample; None before the horizon is found."""
        return None if self._attitude is None else self._attitude.heading_rad

    @property
    def front(self) -> FrontEstimate | None:
        """Where the walking says the front of the body is, against `forward_imu`; None before it is found."""
        return self._front.estimate()

    def mounting(self, yaw_rad: float) -> Quaternion | None:
        """base_link←imu at the start, by gravity, with the front `yaw_rad` beside the supposed one; None before it."""
        return None if self._attitude is None else turned_about_up(self._attitude.start_imu, -yaw_rad)

    @property
    def bias_sd_rad_s(self) -> float:
        """Standard deviation of the gyro bias about the vertical, which says how fast the heading may drift."""
        return math.sqrt(self._drift.covariance[BIAS, BIAS])

    def _initialise(self, sample: ImuSample) -> None:
        initial = self._initial
        dt_ns = sample.stamp_ns - initial[-1].stamp_ns if initial else 0
        if initial and -CLOCK_JUMP_NS <= dt_ns <= 0:
            self.faults["backward" if dt_ns else "duplicate"] += 1
            return
        if not 0 <= dt_ns <= LONGEST_DT_NS:
            initial.clear()
        initial.append(sample)
        if sample.stamp_ns - initial[0].stamp_ns < INITIAL_SPAN_NS:
            return
        fx, fy, fz = np.mean([s.force_m_s2 for s in initial], axis=0)
        initial.clear()
        if math.hypot(fx, fy, fz) < 0.5 * STANDARD_GRAVITY_M_S2:
            self.faults["no_gravity"] += 1
            return
        self._attitude = AttitudeFilter((float(fx), float(fy), float(fz)), self._forward_imu)
        self._last = sample
        self._drift_ns = sample.stamp_ns

    def _irregular(self, sample: ImuSample, dt_ns: int) -> None:
        if -CLOCK_JUMP_NS <= dt_ns <= 0:
            self.faults["backward" if dt_ns else "duplicate"] += 1
            return
        if dt_ns > 0:
            self._unseen("gaps", sample.stamp_ns, dt_ns)
        else:
            self._unseen("clock_jumps", sample.stamp_ns, CLOCK_JUMP_NS)  # how long it took is anyone's guess
        self._last = sample
        self._detector.reset()
        self._motion.clear()
        self._intervals_s = None, None

    def _unseen(self, fault: str, until_ns: int, lasted_ns: int) -> None:
        """What the person did up to the sample at `until_ns` was not measured."""
        self.faults[fault] += 1
        self._carry_drift()
        self._drift.gap(to_s(lasted_ns))
        self._drift_ns = until_ns
        self._rest.reset()
        self._changes.interrupted()
        self.magnetic.interrupted()

    def _advance(
        self, attitude: AttitudeFilter, last: ImuSample, sample: ImuSample, dt_s: float
    ) -> Sequence[StepEvent]:
        (ax, ay, az), (bx, by, bz) = last.rate_rad_s, sample.rate_rad_s
        if clipped_rad_s := _clipped(last.rate_rad_s, sample.rate_rad_s):
            self.faults["saturated"] += 1
            self._carry_drift()
            self._drift.saturation(clipped_rad_s * dt_s)
        attitude.update(dt_s, (0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * (az + bz)), sample.force_m_s2)
        if resting_rate := self._rest.push(dt_s, sample.rate_rad_s, sample.force_m_s2):
            self._learn_bias(attitude, resting_rate)
        self._remember(sample, attitude.orientation_imu)
        steps = self._detector.push(sample.stamp_ns, attitude.motion(sample.rate_rad_s, sample.force_m_s2))
        if steps:
            self._changes.stepped(sample.stamp_ns)
            return [self._walk(attitude, step) for step in steps]
        orientation = attitude.orientation_imu
        self.velocity_change = self._changes.push(sample.stamp_ns, dt_s, orientation, sample.force_m_s2)
        return ()

    def _remember(self, sample: ImuSample, orientation: Quaternion) -> None:
        self._motion.append((sample.stamp_ns, orientation, sample.force_m_s2))
        while self._motion[0][0] < sample.stamp_ns - MOTION_SPAN_NS:
            self._motion.popleft()

    def _learn_bias(self, attitude: AttitudeFilter, rate: Vector3) -> None:
        self._carry_drift()
        gain = self._drift.rest()
        x, y, z = (b + gain * (r - b) for b, r in zip(attitude.bias_rad_s, rate, strict=True))
        attitude.bias_rad_s = (x, y, z)

    def _walk(self, attitude: AttitudeFilter, step: Step) -> StepEvent:
        heading_rad = self._direction(attitude, step)
        self._carry_drift()
        self._drift.turn(math.remainder(heading_rad - self._step_heading_rad, math.tau))
        self._step_heading_rad = heading_rad
        length_m = self._length_m(step)
        dx_m, dy_m = length_m * math.cos(heading_rad), length_m * math.sin(heading_rad)
        own_variance_m2 = STEP_TO_STEP_SD_M**2 + (1.0 - step.confidence) * length_m**2
        along_sd_m = math.sqrt(own_variance_m2 + MISSED_STEP_SHARE * length_m**2)
        self._drift.step(dx_m, dy_m, self._stride.scale, along_sd_m, length_m * DIRECTION_SD_RAD)
        self._x_m += dx_m
        self._y_m += dy_m
        self._way_m += length_m
        self.step_count += 1
        return StepEvent(
            step.stamp_ns,
            self.step_count,
            step.interval_s,
            length_m,
            common_variance_m2(self._stride, length_m) + own_variance_m2,
            heading_rad,
            float(self._drift.covariance[HEADING, HEADING]) + DIRECTION_SD_RAD**2,
            self._x_m,
            self._y_m,
            step.confidence,
        )

    def _direction(self, attitude: AttitudeFilter, step: Step) -> float:
        """Mean facing from the heel strike before to this one, over which the swing of the pelvis mostly cancels.

        What the waist did meanwhile also tells where the front of the body is.
        """
        since_ns = step.stamp_ns - to_ns(step.interval_s or 0.5)
        phase_rad, orientations, forces = self._between(since_ns, step.stamp_ns)
        facing = quaternion.rotate(orientations, attitude.forward_imu)[:, :2]
        if step.interval_s is not None:
            self._front.add(forward_push(phase_rad, _levelled(quaternion.rotate(orientations, forces), facing)))
        east, north = facing.sum(axis=0)
        return math.atan2(north, east)

    def _length_m(self, step: Step) -> float:
        """Its frequency is that of two steps, so that a limp does not lengthen one leg.

        The long interval that begins a walk is no part of its rhythm.
        """
        earlier_s, before_s = self._intervals_s
        self._intervals_s = before_s, step.interval_s
        swing_m_s2 = self._swing_m_s2(step)
        if step.interval_s is None:
            return FIRST_STEP_SHARE * self._stride.length_m(None, swing_m_s2)
        if earlier_s is None or before_s is None:
            return self._stride.length_m(1.0 / step.interval_s, swing_m_s2)
        return self._stride.length_m(2.0 / (before_s + step.interval_s), swing_m_s2)

    def _swing_m_s2(self, step: Step) -> float:
        """Of the vertical acceleration, from one lowest point of the waist to the next."""
        lasted_s = FIRST_SWING_S if step.interval_s is None else min(step.interval_s, SLOWEST_STEP_S)
        until_ns = step.stamp_ns + LOWEST_AFTER_STRIKE_NS
        phase_rad, orientations, forces = self._between(until_ns - to_ns(lasted_s), until_ns)
        return vertical_swing(phase_rad, quaternion.rotate(orientations, forces)[:, 2])

    def _between(
        self, since_ns: int, until_ns: int
    ) -> tuple[NDArray[np.float64], Sequence[Quaternion], Sequence[Vector3]]:
        """Phase, orientations and forces of the samples in (since_ns, until_ns]; of all there are if none are of then.

        The phase (n,) goes from 0 at `since_ns` to 2π at `until_ns`.
        """
        chosen = [m for m in self._motion if since_ns < m[0] <= until_ns] or self._motion
        stamps_ns, orientations, forces = zip(*chosen, strict=True)
        phase_rad = (np.array(stamps_ns) - since_ns) * (math.tau / (until_ns - since_ns))
        return phase_rad, orientations, forces

    def _carry_drift(self) -> None:
        """Bring the drift model up to the last sample."""
        if self._last is not None:
            self._drift.pass_time(to_s(self._last.stamp_ns - self._drift_ns))
            self._drift_ns = self._last.stamp_ns


def _fault(sample: ImuSample) -> str | None:
    if not all(map(math.isfinite, (*sample.rate_rad_s, *sample.force_m_s2))):
        return "not_finite"
    if max(map(abs, sample.rate_rad_s)) > LARGEST_RATE_RAD_S or max(map(abs, sample.force_m_s2)) > LARGEST_FORCE_M_S2:
        return "out_of_range"
    return None


def _levelled(force_m_s2: NDArray[np.float64], facing: NDArray[np.float64]) -> NDArray[np.float64]:
    """Specific force (n, 3) in odom to acceleration along where the waist faces (n, 2), left of it, and up."""
    east, north = (facing / np.linalg.norm(facing, axis=1, keepdims=True)).T
    x, y, z = force_m_s2.T
    return np.column_stack((east * x + north * y, east * y - north * x, z - STANDARD_GRAVITY_M_S2))


def _clipped(before: Vector3, now: Vector3) -> float:
    """The largest turn rate in rad/s that stands at a limit, 0 if none does."""
    x, y, z = now
    if abs(x) < SATURATION_RAD_S and abs(y) < SATURATION_RAD_S and abs(z) < SATURATION_RAD_S:
        return 0.0  # of nearly every sample
    return max(abs(b) if a == b and abs(b) >= SATURATION_RAD_S else 0.0 for a, b in zip(before, now, strict=True))
