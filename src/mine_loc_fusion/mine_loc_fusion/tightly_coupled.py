"""The default estimator: ranges one by one, and steps as ways between heel strikes, in one filter.

Ranges are those of `mine_loc_uwb.robust_tracker`: one-sided noise, biases of links on line, doubt, capture guard. Steps
measure the way since the strike before, turned by the yaw of the odom frame and stretched by the person's scale, both
estimated (`step_kernel`). Where there are no ranges, positions that somebody else solved serve; a recognised turn or a
coarse region is a place like them.
"""

import math
from typing import Any, Self

import numpy as np

from mine_loc_core.gates import chi2_quantile
from mine_loc_core.stamps import to_ns, to_s
from mine_loc_core.verdicts import Reason, Source, Verdict
from mine_loc_core.walkable_area import WalkableArea
from mine_loc_fusion import inertial_kernel, step_kernel
from mine_loc_fusion.estimate import (
    SOURCE_OF,
    Array,
    EpochInputs,
    Estimate,
    PlaceFix,
    StepFix,
    VelocityChange,
    is_position,
    is_step,
    is_velocity_change,
    since_s,
    symmetric,
)
from mine_loc_fusion.gallery_walls import between_walls, inside
from mine_loc_fusion.inertial_prediction import InertialPrediction
from mine_loc_fusion.step_kernel import OWN_STATES, SCALE, YAW
from mine_loc_fusion.tightly_coupled_settings import TightlyCoupledSettings
from mine_loc_fusion.yaw_alignment import YawAlignment
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.robust_tracker import RobustTracker

_SAME_STRIKE_S = 0.05
_STRIKE_SD_M = 0.03
"""Where the waist is at a heel strike, against the step's ends."""
_LEAST_SD_M = 1e-3
"""Nobody is placed better; what claims to would leave a covariance of nothing but rounding."""
_HORIZONTAL = {d: np.ix_([0, 1, d, d + 1], [0, 1, d, d + 1]) for d in (2, 3)}
"""Where a covariance of d coordinates has that of (x, y, vx, vy)."""
_HEIGHT_SD_M = 2.0
_RANGES_HOLD_NS = to_ns(1.0)
"""A position beside ranges not older is made of them."""
_SHARED_SD_M = 0.1
"""What positions of one place share and averaging does not remove."""


class TightlyCoupled:
    """Estimator of one person (see `estimate.Estimator`).

    `height_m`: where the tag is about, in a place where heights are solved for; None = heights are given. `area`: whose
    walls bound what is put out; None = no map.
    """

    def __init__(
        self,
        settings: TightlyCoupledSettings | None = None,
        height_m: float | None = None,
        area: WalkableArea | None = None,
    ) -> None:
        self._s = settings or TightlyCoupledSettings()
        self._height_m = height_m
        self._area = area
        self._gate = chi2_quantile(self._s.gate_probability, 2)
        self._believed = self._s.alone
        self._tracker = RobustTracker(self._believed, OWN_STATES)
        self._systematic_m2 = np.zeros((2, 2))
        self._starts = 0
        self._alignment = YawAlignment()
        self._inertial = InertialPrediction(self._s.inertial)
        self._yaw_known = False
        self._stamp_ns = 0
        self._strike_ns: int | None = None
        self._step_ns: int | None = None
        self._velocity_ns: int | None = None
        self._change_ns: int | None = None
        self._uwb_ns: int | None = None
        self._ranges_ns: int | None = None
        self._region_ns: int | None = None
        self._rock_ns: int | None = None
        self._refused_since_ns: int | None = None

    def begin(self, stamp_ns: int, position_m: Array, covariance_m2: Array, yaw: tuple[float, float] | None) -> None:
        """See Estimator."""
        covariance_m2 = _believable(covariance_m2)
        if self._height_m is not None:
            position_m = np.append(position_m, self._height_m)
            covariance_m2 = np.pad(covariance_m2, ((0, 1), (0, 1)))
            covariance_m2[2, 2] = _HEIGHT_SD_M**2
        self._tracker.place(stamp_ns, position_m, covariance_m2)
        self._after_start(stamp_ns)
        if yaw is not None:
            self._set_yaw(*yaw)

    def update(self, inputs: EpochInputs) -> tuple[Verdict, ...]:
        """See Estimator."""
        self._advance(inputs.stamp_ns)
        verdicts = [self._use_velocity_change(change, inputs.stamp_ns) for change in inputs.velocity_changes]
        for measurements in inputs.ranges:
            verdicts += self._use_ranges(measurements)
        for fix in inputs.positions:
            place = PlaceFix(Source.UWB_POSE, fix.position_m, fix.covariance_m2 + _SHARED_SD_M**2 * np.eye(2))
            verdicts.append(self._use_position(place, inputs.stamp_ns))
        verdicts += [self._use_step(step, inputs.stamp_ns) for step in inputs.steps]
        verdicts += [self._use_place(place, inputs.stamp_ns) for place in inputs.places]
        if self._area is not None and self._tracker.started:
            self._come_inside(self._area)
        return tuple(verdicts)

    def estimate(self, stamp_ns: int) -> Estimate | None:
        """See Estimator."""
        tracker = self._tracker
        if not tracker.started:
            return None
        d, ahead_s = tracker.dimensions, max(to_s(stamp_ns - self._stamp_ns), 0.0)
        position, velocity = tracker.x[:2].copy(), tracker.x[d : d + 2].copy()
        covariance = tracker.P[_HORIZONTAL[d]]
        if ahead_s > 0.0:
            position += ahead_s * velocity
            covariance = _ahead(covariance, ahead_s, self._s.stepping.acceleration_density_m2_s3)
        covariance[:2, :2] += self._systematic_m2
        if self._area is not None:
            doubted = since_s(self._rock_ns, stamp_ns) < self._s.in_rock_counts_s
            position, velocity, covariance = between_walls(position, velocity, covariance, self._area, doubted=doubted)
        yaw = float(tracker.x[self._own + YAW]) if self._yaw_known else None
        uwb_s, step_s, region_s = (since_s(each, stamp_ns) for each in (self._uwb_ns, self._step_ns, self._region_ns))
        height_m = None if d == 2 else float(tracker.x[2])
        return Estimate(stamp_ns, position, velocity, covariance, yaw, uwb_s, step_s, region_s, height_m)

    def save(self) -> Any:
        """See Estimator."""
        return self._copied()

    def restore(self, saved: Any) -> None:
        """See Estimator."""
        vars(self).update(vars(saved._copied()))  # noqa: SLF001 one of this class

    def _copied(self) -> Self:
        other = object.__new__(type(self))
        state = vars(other)
        state.update(vars(self))
        state["_tracker"] = self._tracker.copy()
        if not self._yaw_known:
            state["_alignment"] = self._alignment.copy()
        return other

    @property
    def _own(self) -> int:
        return self._tracker.first_link - OWN_STATES

    def _advance(self, stamp_ns: int) -> None:
        gone_s = to_s(stamp_ns - self._stamp_ns)
        tracker = self._tracker
        if not tracker.started or gone_s <= 0.0:
            return
        self._stamp_ns = stamp_ns
        tracker.advance(stamp_ns)
        yaw_m2, scale_m2 = self._s.yaw_walk_sd_rad**2 * gone_s, self._s.scale_walk_sd**2 * gone_s
        step_kernel.drift(tracker.P, tracker.first_link, yaw_m2, scale_m2)
        tracker.motion_known = self._yaw_known and since_s(self._step_ns, stamp_ns) < self._s.motion_known_s
        carried = self._yaw_known or since_s(self._change_ns, stamp_ns) < self._s.motion_known_s
        believed = self._s.stepping if tracker.motion_known else self._s.carried if carried else self._s.alone
        if believed is not self._believed:
            self._believed = believed
            tracker.believe(believed)

    def _use_velocity_change(self, change: VelocityChange, stamp_ns: int) -> Verdict:
        """Where steps tell the motion a waist swings with each: they are better."""
        if not is_velocity_change(change):
            return Verdict(Source.IMU, 0, Reason.INVALID)
        if not self._tracker.started:
            return Verdict(Source.IMU, 0, Reason.NOT_INITIALISED)
        if self._tracker.motion_known:
            return Verdict(Source.IMU, 0, Reason.DUPLICATE)
        gone_s = None if self._velocity_ns is None else to_s(stamp_ns - self._velocity_ns)
        self._velocity_ns = stamp_ns
        verdict = self._inertial.take(self._tracker, change, gone_s, yaw_known=self._yaw_known)
        if verdict.accepted:
            self._change_ns = stamp_ns
        self._yaw_known = self._yaw_known or self._inertial.settle_yaw(self._tracker)
        return verdict

    def _use_ranges(self, measurements: Measurements) -> list[Verdict]:
        solution = self._tracker.solve(measurements)
        if self._tracker.starts != self._starts:
            self._after_start(measurements.stamp_ns)
        self._ranges_ns = measurements.stamp_ns
        if Reason.ACCEPTED in solution.reasons:  # else what held before still does
            self._systematic_m2 = _covariance_or_none(solution.fix.covariance_m2[:2, :2] - self._tracker.P[:2, :2])
            self._uwb_ns = measurements.stamp_ns
        source, gate = SOURCE_OF["ranges"](measurements), solution.gate
        rows = zip(measurements.anchor_ids.tolist(), solution.reasons, solution.mahalanobis_sq.tolist(), strict=True)
        return [Verdict(source, anchor, reason, d2, gate, 1) for anchor, reason, d2 in rows]

    def _use_position(self, place: PlaceFix, stamp_ns: int) -> Verdict:
        if self._ranges_ns is not None and stamp_ns - self._ranges_ns < _RANGES_HOLD_NS:
            return Verdict(Source.UWB_POSE, 0, Reason.DUPLICATE)
        verdict = self._use_place(place, stamp_ns)
        if verdict.accepted:
            self._uwb_ns, self._refused_since_ns = stamp_ns, None
        elif verdict.reason is Reason.GATE:
            self._refused_since_ns = self._refused_since_ns or stamp_ns
            if to_s(stamp_ns - self._refused_since_ns) >= self._s.alone.reopen_after_s:
                self.begin(stamp_ns, place.position_m, place.covariance_m2, None)
                self._uwb_ns, self._refused_since_ns = stamp_ns, None
                return Verdict(Source.UWB_POSE, 0, Reason.ACCEPTED)
        return verdict

    def _come_inside(self, area: WalkableArea) -> None:
        tracker = self._tracker
        found = inside(tracker.x[:2], area)
        if found is not None:
            step_kernel.take_place(tracker.x, tracker.P, *found, math.inf)
            self._rock_ns = self._stamp_ns

    def _use_place(self, place: PlaceFix, stamp_ns: int) -> Verdict:
        if not is_position(place.position_m, place.covariance_m2):
            return Verdict(place.source, 0, Reason.INVALID)
        if place.source is Source.REGION:
            self._region_ns = stamp_ns
        if not self._tracker.started:
            self.begin(stamp_ns, place.position_m, place.covariance_m2, None)
            return Verdict(place.source, 0, Reason.ACCEPTED)
        tracker = self._tracker
        innovation_m = float(np.linalg.norm(place.position_m - tracker.x[:2]))
        noise_m2 = _believable(place.covariance_m2)
        d2 = step_kernel.take_place(tracker.x, tracker.P, place.position_m, noise_m2, self._gate)
        reason = Reason.ACCEPTED if d2 <= self._gate else Reason.GATE
        return Verdict(place.source, 0, reason, d2, self._gate, 2, innovation_m)

    def _after_start(self, stamp_ns: int) -> None:
        """The first place, or one far from the last: the track before it is not this one's."""
        tracker, own = self._tracker, self._own
        if self._starts == 0:
            tracker.P[own + SCALE, own + SCALE] = self._s.scale_sd**2
        self._starts = tracker.starts
        self._alignment.forget_places()
        self._velocity_ns = None
        self._strike_ns = None
        self._stamp_ns = stamp_ns

    def _set_yaw(self, yaw_rad: float, variance_rad2: float) -> None:
        tracker, yaw = self._tracker, self._own + YAW
        tracker.x[yaw] = yaw_rad
        tracker.P[yaw, :] = tracker.P[:, yaw] = 0.0
        tracker.P[yaw, yaw] = variance_rad2
        self._yaw_known = True

    def _use_step(self, step: StepFix, stamp_ns: int) -> Verdict:
        if not is_step(step):
            return Verdict(Source.STEP, 0, Reason.INVALID)
        self._step_ns = stamp_ns
        tracker = self._tracker
        if not tracker.started:
            return Verdict(Source.STEP, 0, Reason.NOT_INITIALISED)
        before_ns, self._strike_ns = self._strike_ns, stamp_ns
        verdict = Verdict(Source.STEP, 0, Reason.NOT_INITIALISED)
        if not self._yaw_known:
            found = self._alignment.step(step.length_m, step.heading_rad, tracker.x[:2])
            if found is not None:
                self._set_yaw(*found)
        elif before_ns is not None and abs(to_s(stamp_ns - before_ns) - step.interval_s) < _SAME_STRIKE_S:
            verdict = self._measure_way(step)
        step_kernel.remember_strike(tracker.x, tracker.P, tracker.first_link)
        return verdict

    def _measure_way(self, step: StepFix) -> Verdict:
        """A step that steady walking does not explain is tried again as one round a corner."""
        tracker, s = self._tracker, self._s
        along_m2 = (s.step_along_sd * step.length_m) ** 2 + _STRIKE_SD_M**2
        way = step.length_m, step.heading_rad, along_m2, s.step_across_sd_m**2, self._gate
        d2 = step_kernel.take_step(tracker.x, tracker.P, tracker.first_link, *way)
        if d2 > self._gate:
            step_kernel.allow_turn(tracker.P, tracker.dimensions, step.interval_s, s.turn_density_m2_s3)
            d2 = step_kernel.take_step(tracker.x, tracker.P, tracker.first_link, *way)
        reason = Reason.ACCEPTED if d2 <= self._gate else Reason.GATE
        return Verdict(Source.STEP, 0, reason, d2, self._gate, 2)


def rehearse(dimensions: int, area: WalkableArea | None = None) -> None:
    """Take made-up measurements, so that what is compiled is there before the first real ones come."""
    height_m, at_m, spread_m2 = 1.0 if dimensions == 3 else None, np.zeros(2), np.eye(2)
    estimator = TightlyCoupled(height_m=height_m, area=area)
    estimator.begin(0, at_m, spread_m2, (0.0, 1.0))
    anchors_m = np.array([[9.0, 0.0, 2.0], [0.0, 9.0, 3.0]])
    none, plane_m = np.full(2, math.nan), 1.0 if dimensions == 2 else None
    ids, range_m = np.array([1, 2], np.uint64), np.linalg.norm(anchors_m, axis=1)
    change = VelocityChange(np.zeros(3), 0.1)
    for stamp_ns in (to_ns(0.1), to_ns(0.2)):  # before the steps, beside which they are not used
        estimator.update(EpochInputs(stamp_ns, velocity_changes=(change,)))
    tracker = estimator._tracker  # noqa: SLF001 its own
    inertial_kernel.settle_yaw(np.ones_like(tracker.x), tracker.P.copy(), dimensions, tracker.first_link)
    step = StepFix(0.7, 0.01, 0.0, 0.01, 0.5)
    for stamp_ns in (to_ns(0.5), to_ns(1.0)):
        measurements = Measurements(
            stamp_ns, ids, anchors_m, range_m, np.full(2, 0.01), np.zeros(2), none, none, plane_m
        )
        place = PlaceFix(Source.LANDMARK, at_m, spread_m2)
        estimator.update(EpochInputs(stamp_ns, steps=(step,), ranges=(measurements,), places=(place,)))
        estimator.estimate(stamp_ns)


def _covariance_or_none(difference_m2: Array) -> Array:
    """The difference (2, 2) of two covariances, nothing where it is none: a tracker in doubt widens the diagonal."""
    (a, b), (_, c) = difference_m2.tolist()
    return difference_m2 if a >= 0.0 and c >= 0.0 and a * c >= (1.0 - 1e-9) * b * b else np.zeros((2, 2))


def _believable(covariance_m2: Array) -> Array:
    """Covariance (2, 2) of a place as it can be used."""
    used: Array = symmetric(covariance_m2) + _LEAST_SD_M**2 * np.eye(2)
    return used


def _ahead(covariance: Array, ahead_s: float, density_m2_s3: float) -> Array:
    """Covariance (4, 4) of horizontal position and velocity after a while of white acceleration."""
    F = np.eye(4)
    F[0, 2] = F[1, 3] = ahead_s
    q = density_m2_s3 * ahead_s
    added = np.diag([q * ahead_s**2 / 3.0, q * ahead_s**2 / 3.0, q, q])
    added[0, 2] = added[2, 0] = added[1, 3] = added[3, 1] = q * ahead_s / 2.0
    moved: Array = F @ covariance @ F.T + added
    return moved
