"""Inertial prediction where there are no steps: changes of velocity carry the track between ranges."""

import math
from dataclasses import dataclass

import numpy as np

from mine_loc_core.gates import chi2_quantile
from mine_loc_core.verdicts import Reason, Source, Verdict
from mine_loc_fusion import inertial_kernel as kernel
from mine_loc_fusion.estimate import VelocityChange
from mine_loc_fusion.step_kernel import OWN_STATES
from mine_loc_uwb.robust_tracker import RobustTracker

_SAME_INSTANT_S = 0.02
_CONTRADICTED_SDS = 3.0


@dataclass(frozen=True, slots=True)
class InertialSettings:
    """Of the acceleration that dead reckoning tells, free of gravity, in odom; docs/fusion.md says where from."""

    noise_density_m2_s3: float = 0.02**2
    horizontal_error_sd_m_s2: float = 0.2
    """Mostly gravity on a horizon that is a degree off."""
    horizontal_error_time_s: float = 5.0
    """Dead reckoning finds the horizon anew within so long."""
    vertical_error_sd_m_s2: float = 0.15
    """Of the accelerometer's scale and zero."""
    vertical_error_time_s: float = 1000.0
    yaw_known_sd_rad: float = math.radians(10.0)
    gate_probability: float = 0.9999


class InertialPrediction:
    """Takes velocity changes into a tracker, which gets the states that they need with the first one."""

    def __init__(self, settings: InertialSettings | None = None) -> None:
        self._s = s = settings or InertialSettings()
        self._error_sd_m_s2 = np.array([s.horizontal_error_sd_m_s2] * 2 + [s.vertical_error_sd_m_s2])
        self._error_time_s = np.array([s.horizontal_error_time_s] * 2 + [s.vertical_error_time_s])

    def take(self, tracker: RobustTracker, change: VelocityChange, gone_s: float | None, *, yaw_known: bool) -> Verdict:
        """Use the change of a started tracker's velocity that ends now, `gone_s` after the last one, None = the first.

        One that does not follow on the last is not measured: the velocity at its beginning was not kept.
        """
        d = tracker.dimensions
        if not _has_states(tracker):
            tracker.add_states(kernel.inertial_states(d))
            kernel.begin(tracker.x, tracker.P, d, self._error_sd_m_s2)
        verdict = Verdict(Source.IMU, 0, Reason.NOT_INITIALISED)
        if gone_s is not None:
            kernel.pass_time(tracker.x, tracker.P, d, gone_s, self._error_sd_m_s2, self._error_time_s)
            if abs(gone_s - change.interval_s) < _SAME_INSTANT_S:
                verdict = self._measure(tracker, change, yaw_known=yaw_known)
        kernel.remember_velocity(tracker.x, tracker.P, d)
        return verdict

    def _measure(self, tracker: RobustTracker, change: VelocityChange, *, yaw_known: bool) -> Verdict:
        d, gate = tracker.dimensions, chi2_quantile(self._s.gate_probability, tracker.dimensions)
        variance_m2_s2 = self._s.noise_density_m2_s3 * change.interval_s
        how = int(yaw_known), change.change_m_s, change.interval_s, variance_m2_s2, gate
        d2 = kernel.take_velocity_change(tracker.x, tracker.P, d, tracker.first_link, *how)
        return Verdict(Source.IMU, 0, Reason.ACCEPTED if d2 <= gate else Reason.GATE, d2, gate, d)

    def settle_yaw(self, tracker: RobustTracker) -> bool:
        """Hand the yaw of odom on as the angle that steps use, once the changes tell it well enough.

        A cosine and a sine whose squares do not add up to 1 are of no angle (ranges that drag the track, a map whose z
        axis points down): then they are sought anew.
        """
        if not _has_states(tracker):
            return False
        first = 2 * tracker.dimensions + 1
        states = slice(first + kernel.COSINE, first + kernel.SINE + 1)
        sd = math.sqrt(np.linalg.eigvalsh(tracker.P[states, states])[-1])
        length = float(np.linalg.norm(tracker.x[states]))
        if length + _CONTRADICTED_SDS * sd < 1.0:
            kernel.forget_yaw(tracker.x, tracker.P, tracker.dimensions)
            return False
        known = sd <= self._s.yaw_known_sd_rad * length
        if known:
            kernel.settle_yaw(tracker.x, tracker.P, tracker.dimensions, tracker.first_link)
        return known


def _has_states(tracker: RobustTracker) -> bool:
    return tracker.first_link > 2 * tracker.dimensions + 1 + OWN_STATES
