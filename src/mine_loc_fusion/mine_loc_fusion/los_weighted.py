"""Paper A's fusion: Z = ω_u Z_u + ω_p Z_p, weighted by the class of the links and the accuracy of the two.

Z_p is the last fused position carried on by the steps since; Z_u the position solved from the ranges. The weights are
those of relative accuracy, ω_u = σ_p² / (σ_u² + σ_p²), with σ_u² by the class: p σ_LOS² + (1 − p) σ_NLOS² for a
probability p of line of sight. With a residual test, a position farther from Z_p than both accuracies explain counts as
one without line of sight, whatever its class.

Paper A lays the steps on the map once. Ours: what turns and stretches them is corrected by the same residual, in the
measure in which its error has moved Z_p since. A place is a complex number, x + i y, a step one of the odom frame, and
the map has the step times a complex factor: all is linear, and the covariance of place and factor that of a Kalman
filter of two complex states.
"""

import cmath
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
    factor_walk_sd: float = 0.003
    """By which steps turn [rad] and stretch, over a square root of a second."""
    residual_gate: float | None = None
    """Deviations at which the residual test strikes; None = no test."""


class LosWeighted(LooselyCoupled):
    """Estimator of one person (see `estimate.Estimator`)."""

    def __init__(self, settings: LosWeightedSettings | None = None) -> None:
        super().__init__()
        self._s = settings or LosWeightedSettings()
        self._stamp_ns: int | None = None
        self._place_m = 0j
        self._variance_m2 = 0.0
        self._factor: complex | None = None
        self._factor_variance = 0.0
        # mean of the place's error times the conjugate of the factor's, halved as variances are
        self._covariance_m = 0j
        self._velocity_ms = 0j
        self._carried_m = 0j
        self._strike_ns: int | None = None
        self._uwb_ns: int | None = None

    def begin(self, stamp_ns: int, position_m: Array, covariance_m2: Array, yaw: tuple[float, float] | None) -> None:
        """See Estimator."""
        self._stamp_ns = stamp_ns
        self._place_m, self._variance_m2 = complex(*position_m), float(np.trace(covariance_m2)) / 2.0
        self._velocity_ms = self._carried_m = self._covariance_m = 0j
        self._alignment.forget_places()
        if yaw is not None:
            self._set_yaw(*yaw)

    def estimate(self, stamp_ns: int) -> Estimate | None:
        """See Estimator."""
        if self._stamp_ns is None:
            return None
        variance_m2 = self._variance_m2 + self._s.rest_sd_m**2 * self._gone_s(stamp_ns)
        covariance = np.diag([variance_m2, variance_m2, 1.0, 1.0])
        since_uwb_s, since_step_s = since_s(self._uwb_ns, stamp_ns), since_s(self._strike_ns, stamp_ns)
        at, velocity = self._place_m + self._way_m(stamp_ns), self._velocity_ms
        yaw_rad = None if self._factor is None else cmath.phase(self._factor)
        return Estimate(stamp_ns, _pair(at), _pair(velocity), covariance, yaw_rad, since_uwb_s, since_step_s)

    def _set_yaw(self, yaw_rad: float, variance_rad2: float) -> None:
        self._factor, self._factor_variance = cmath.rect(1.0, yaw_rad), variance_rad2
        self._covariance_m = 0j

    def _advance(self, stamp_ns: int) -> None:
        gone_s = self._gone_s(stamp_ns)
        if gone_s == 0.0:
            return
        way_m = self._way_m(stamp_ns)
        self._variance_m2 += self._s.rest_sd_m**2 * gone_s
        self._factor_variance += self._s.factor_walk_sd**2 * gone_s
        self._place_m += way_m
        self._carried_m += way_m
        self._stamp_ns = stamp_ns

    def _gone_s(self, stamp_ns: int) -> float:
        return 0.0 if self._stamp_ns is None else max(0.0, to_s(stamp_ns - self._stamp_ns))

    def _way_m(self, stamp_ns: int) -> complex:
        """From the state's instant on, at the last step's speed."""
        if self._strike_ns is None or self._stamp_ns is None:
            return 0j
        walked_s, walks_s = (to_s(each - self._strike_ns) for each in (self._stamp_ns, stamp_ns))
        return self._velocity_ms * max(0.0, min(walks_s, _LONGEST_CARRY_S) - walked_s)

    def _use_position(self, fix: PositionFix, stamp_ns: int) -> Verdict:
        if not is_position(fix.position_m, fix.covariance_m2):
            return Verdict(Source.UWB_POSE, 0, Reason.INVALID)
        self._uwb_ns = stamp_ns
        if self._stamp_ns is None:
            self.begin(stamp_ns, fix.position_m, fix.covariance_m2, None)
            return Verdict(Source.UWB_POSE, 0, Reason.ACCEPTED)
        los = fix.los_probability if 0.0 <= fix.los_probability <= 1.0 else 0.5
        variance_m2 = los * self._s.los_sd_m**2 + (1.0 - los) * self._s.nlos_sd_m**2
        residual_m = complex(*fix.position_m) - self._place_m
        distance_sq = abs(residual_m) ** 2 / (variance_m2 + self._variance_m2)
        gate = math.inf if self._s.residual_gate is None else self._s.residual_gate**2
        if distance_sq > gate:
            variance_m2 = max(self._s.nlos_sd_m**2, abs(residual_m) ** 2)
        self._correct(residual_m, variance_m2)
        return Verdict(Source.UWB_POSE, 0, Reason.ACCEPTED, distance_sq, gate, 2, abs(residual_m))

    def _correct(self, residual_m: complex, variance_m2: float) -> None:
        """Weight Z_u by ω_u, and let the factor follow by what its error has to do with that of Z_p."""
        weight = self._variance_m2 / (variance_m2 + self._variance_m2)
        if self._factor is not None:
            share = self._covariance_m.conjugate() / (variance_m2 + self._variance_m2)
            self._factor += share * residual_m
            self._factor_variance -= (share * self._covariance_m).real
        self._covariance_m *= 1.0 - weight
        self._place_m += weight * residual_m
        self._variance_m2 *= 1.0 - weight

    def _use_step(self, step: StepFix, stamp_ns: int) -> Verdict:
        if not is_step(step):
            return Verdict(Source.STEP, 0, Reason.INVALID)
        self._strike_ns = stamp_ns
        if self._stamp_ns is None:
            return Verdict(Source.STEP, 0, Reason.NOT_INITIALISED)
        if self._factor is None:
            found = self._alignment.step(step.length_m, step.heading_rad, _pair(self._place_m))
            if found is not None:
                self._set_yaw(*found)
            return Verdict(Source.STEP, 0, Reason.NOT_INITIALISED)
        odom_m = cmath.rect(step.length_m, step.heading_rad)
        way_m = self._factor * odom_m
        self._place_m += way_m - self._carried_m
        step_variance = self._factor_variance + self._s.step_share**2
        self._variance_m2 += 2.0 * (odom_m.conjugate() * self._covariance_m).real + step_variance * step.length_m**2
        self._covariance_m += odom_m * self._factor_variance
        self._carried_m = 0j
        if step.interval_s > _LEAST_INTERVAL_S:
            self._velocity_ms = way_m / step.interval_s
        return Verdict(Source.STEP, 0, Reason.ACCEPTED)


def _pair(number: complex) -> Array:
    return np.array([number.real, number.imag])
