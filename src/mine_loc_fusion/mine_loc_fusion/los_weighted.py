"""Paper A's fusion: Z = ω_u Z_u + ω_p Z_p, weighted by the class of the links and the accuracy of the two.

Z_p is the last fused position carried on by the steps since; Z_u the position solved from the ranges. The weights are
those of relative accuracy, ω_u = σ_p² / (σ_u² + σ_p²), with σ_u² by the class: p σ_LOS² + (1 − p) σ_NLOS² for a
probability p of line of sight. With a residual test, a position farther from Z_p than both accuracies explain counts as
one without line of sight, whatever its class.
"""

import math
from dataclasses import dataclass

import numpy as np

from mine_loc_core.stamps import to_s
from mine_loc_core.verdicts import Reason, Source, Verdict
from mine_loc_fusion.estimate import Array, Estimate, PositionFix, StepFix, is_position, is_step, since_s
from mine_loc_fusion.loosely_coupled import LooselyCoupled

_LONGEST_CARRY_S = 1.0
"""A person walks on at the last step's speed until the next one is reported, no longer."""
_LEAST_INTERVAL_S = 0.2
"""Nobody steps faster: a shorter interval tells no speed."""


@dataclass(frozen=True, slots=True)
class LosWeightedSettings:
    """Accuracies of the two sources."""

    los_sd_m: float = 0.2
    nlos_sd_m: float = 5.0
    step_share: float = 0.1
    """Standard deviation of a step over its length."""
    rest_sd_m: float = 0.05
    """What a second adds without steps."""
    residual_gate: float | None = None
    """Deviations at which the residual test strikes; None = no test."""


class LosWeighted(LooselyCoupled):
    """Estimator of one person (see `estimate.Estimator`)."""

    def __init__(self, settings: LosWeightedSettings | None = None) -> None:
        super().__init__()
        self._s = settings or LosWeightedSettings()
        self._stamp_ns: int | None = None
        self._position_m = np.zeros(2)
        self._variance_m2 = 0.0
        self._velocity_ms = np.zeros(2)
        self._carried_m = np.zeros(2)
        self._strike_ns: int | None = None
        self._uwb_ns: int | None = None
        self._yaw_rad: float | None = None

    def begin(self, stamp_ns: int, position_m: Array, covariance_m2: Array, yaw: tuple[float, float] | None) -> None:
        """See Estimator."""
        self._stamp_ns = stamp_ns
        self._position_m, self._variance_m2 = position_m.copy(), float(np.trace(covariance_m2)) / 2.0
        self._velocity_ms, self._carried_m = np.zeros(2), np.zeros(2)
        self._alignment.forget_places()
        if yaw is not None:
            self._yaw_rad = yaw[0]

    def estimate(self, stamp_ns: int) -> Estimate | None:
        """See Estimator."""
        if self._stamp_ns is None:
            return None
        way_m = self._way_m(stamp_ns)
        variance_m2 = self._variance_m2 + self._added_m2(stamp_ns)
        covariance = np.diag([variance_m2, variance_m2, 1.0, 1.0])
        since_uwb_s, since_step_s = since_s(self._uwb_ns, stamp_ns), since_s(self._strike_ns, stamp_ns)
        at = self._position_m + way_m
        return Estimate(stamp_ns, at, self._velocity_ms, covariance, self._yaw_rad, since_uwb_s, since_step_s)

    def _advance(self, stamp_ns: int) -> None:
        if self._stamp_ns is None or stamp_ns <= self._stamp_ns:
            return
        way_m = self._way_m(stamp_ns)
        self._variance_m2 += self._added_m2(stamp_ns)
        self._position_m = self._position_m + way_m
        self._carried_m = self._carried_m + way_m
        self._stamp_ns = stamp_ns

    def _way_m(self, stamp_ns: int) -> Array:
        """From the state's instant on, at the last step's speed."""
        if self._strike_ns is None or self._stamp_ns is None:
            return np.zeros(2)
        walked_s, walks_s = (to_s(each - self._strike_ns) for each in (self._stamp_ns, stamp_ns))
        way_m: Array = self._velocity_ms * max(0.0, min(walks_s, _LONGEST_CARRY_S) - walked_s)
        return way_m

    def _added_m2(self, stamp_ns: int) -> float:
        assert self._stamp_ns is not None
        return self._s.rest_sd_m**2 * max(0.0, to_s(stamp_ns - self._stamp_ns))

    def _use_position(self, fix: PositionFix, stamp_ns: int) -> Verdict:
        if not is_position(fix.position_m, fix.covariance_m2):
            return Verdict(Source.UWB_POSE, 0, Reason.INVALID)
        self._uwb_ns = stamp_ns
        if self._stamp_ns is None:
            self.begin(stamp_ns, fix.position_m, fix.covariance_m2, None)
            return Verdict(Source.UWB_POSE, 0, Reason.ACCEPTED)
        los = fix.los_probability if 0.0 <= fix.los_probability <= 1.0 else 0.5
        variance_m2 = los * self._s.los_sd_m**2 + (1.0 - los) * self._s.nlos_sd_m**2
        residual_m = fix.position_m - self._position_m
        distance_sq = float(residual_m @ residual_m) / (variance_m2 + self._variance_m2)
        gate = math.inf if self._s.residual_gate is None else self._s.residual_gate**2
        if distance_sq > gate:
            variance_m2 = max(self._s.nlos_sd_m**2, float(residual_m @ residual_m))
        weight = self._variance_m2 / (variance_m2 + self._variance_m2)
        self._position_m = self._position_m + weight * residual_m
        self._variance_m2 *= 1.0 - weight
        innovation_m = float(np.linalg.norm(residual_m))
        return Verdict(Source.UWB_POSE, 0, Reason.ACCEPTED, distance_sq, gate, 2, innovation_m)

    def _use_step(self, step: StepFix, stamp_ns: int) -> Verdict:
        if not is_step(step):
            return Verdict(Source.STEP, 0, Reason.INVALID)
        self._strike_ns = stamp_ns
        if self._stamp_ns is None:
            return Verdict(Source.STEP, 0, Reason.NOT_INITIALISED)
        if self._yaw_rad is None:
            found = self._alignment.step(step.length_m, step.heading_rad, self._position_m)
            self._yaw_rad = None if found is None else found[0]
            return Verdict(Source.STEP, 0, Reason.NOT_INITIALISED)
        heading = step.heading_rad + self._yaw_rad
        way_m = step.length_m * np.array([math.cos(heading), math.sin(heading)])
        self._position_m = self._position_m + way_m - self._carried_m
        self._variance_m2 += (self._s.step_share * step.length_m) ** 2
        self._carried_m = np.zeros(2)
        if step.interval_s > _LEAST_INTERVAL_S:
            self._velocity_ms = way_m / step.interval_s
        return Verdict(Source.STEP, 0, Reason.ACCEPTED)
