"""An extended Kalman filter of solved positions and steps, loosely coupled, on (x, y, vx, vy, yaw offset): a rival.

Between measurements the velocity is driven by white acceleration and fades, so that a person nobody hears of is
expected to stay while the covariance grows. A step is a velocity measurement along its heading, turned by the yaw of
the odom frame in the map.
"""

import math
from dataclasses import dataclass

import numpy as np

from mine_loc_core.gates import chi2_quantile
from mine_loc_core.stamps import to_ns, to_s
from mine_loc_core.verdicts import Reason, Source, Verdict
from mine_loc_fusion.estimate import (
    Array,
    Estimate,
    PositionFix,
    StepFix,
    is_position,
    is_step,
    since_s,
    symmetric,
)
from mine_loc_fusion.loosely_coupled import LooselyCoupled

_VELOCITY_FADE_S = 3.0
_WALKING_SD_MS = 1.0  # prior of a person's velocity
_YAW_DRIFT_SD = math.radians(0.5)  # per square root of a second
_MAX_PREDICTION_S = 600.0


@dataclass(frozen=True, slots=True)
class EkfSettings:
    """What is believed of the person and of positions."""

    acceleration_sd: float = 1.0
    """How abruptly people change speed, over one second [m/s²]."""
    position_sd_m: float = 0.1
    """What positions of one place share and averaging does not remove: added to what they claim."""
    step_velocity_sd_ms: float = 0.25
    """The waist's speed varies within a step."""
    gate_probability: float = 0.999
    reopen_s: float = 2.0
    """Positions refused for so long start the filter anew."""


class Ekf(LooselyCoupled):
    """Estimator of one person (see `estimate.Estimator`)."""

    def __init__(self, settings: EkfSettings | None = None) -> None:
        super().__init__()
        self._s = settings or EkfSettings()
        self._gate = chi2_quantile(self._s.gate_probability, 2)
        self._stamp_ns: int | None = None
        self._x = np.zeros(5)
        self._P = np.eye(5)
        self._yaw_known = False
        self._uwb_ns: int | None = None
        self._step_ns: int | None = None
        self._refused_since_ns: int | None = None

    def begin(self, stamp_ns: int, position_m: Array, covariance_m2: Array, yaw: tuple[float, float] | None) -> None:
        """See Estimator."""
        if yaw is None and self._yaw_known:
            yaw = float(self._x[4]), float(self._P[4, 4])
        self._yaw_known = yaw is not None
        yaw_rad, yaw_variance = yaw or (0.0, math.pi**2)
        self._x = np.array([position_m[0], position_m[1], 0.0, 0.0, yaw_rad])
        self._P = np.diag([0.0, 0.0, _WALKING_SD_MS**2, _WALKING_SD_MS**2, yaw_variance])
        self._P[:2, :2] = symmetric(covariance_m2)
        self._stamp_ns = stamp_ns
        self._alignment.forget_places()

    def estimate(self, stamp_ns: int) -> Estimate | None:
        """See Estimator."""
        if self._stamp_ns is None:
            return None
        x, P = self._predicted(stamp_ns)
        since_uwb_s, since_step_s = since_s(self._uwb_ns, stamp_ns), since_s(self._step_ns, stamp_ns)
        yaw = float(x[4]) if self._yaw_known else None
        shared = self._s.position_sd_m**2
        covariance = P[:4, :4] + np.diag([shared, shared, 0.0, 0.0])
        return Estimate(stamp_ns, x[:2], x[2:4], covariance, yaw, since_uwb_s, since_step_s)

    def _advance(self, stamp_ns: int) -> None:
        if self._stamp_ns is not None:
            self._x, self._P = self._predicted(stamp_ns)
            self._stamp_ns = max(self._stamp_ns, stamp_ns)

    def _predicted(self, stamp_ns: int) -> tuple[Array, Array]:
        assert self._stamp_ns is not None
        dt = min(max(0.0, to_s(stamp_ns - self._stamp_ns)), _MAX_PREDICTION_S)
        if dt == 0.0:
            return self._x.copy(), self._P.copy()
        fade = math.exp(-dt / _VELOCITY_FADE_S)
        reach = _VELOCITY_FADE_S * (1.0 - fade)
        F = np.eye(5)
        F[0, 2] = F[1, 3] = reach
        F[2, 2] = F[3, 3] = fade
        rate = self._s.acceleration_sd**2  # of an Ornstein–Uhlenbeck velocity, per second
        q_vv = rate * _VELOCITY_FADE_S / 2.0 * (1.0 - fade**2)
        q_pv = rate * reach**2 / 2.0
        q_pp = rate * _VELOCITY_FADE_S**2 * (dt - 2.0 * reach + _VELOCITY_FADE_S / 2.0 * (1.0 - fade**2))
        Q = np.zeros((5, 5))
        Q[0, 0] = Q[1, 1] = max(q_pp, 0.0)
        Q[2, 2] = Q[3, 3] = q_vv
        Q[0, 2] = Q[2, 0] = Q[1, 3] = Q[3, 1] = q_pv
        Q[4, 4] = _YAW_DRIFT_SD**2 * dt
        P = F @ self._P @ F.T + Q
        return F @ self._x, (P + P.T) / 2.0

    def _use_position(self, fix: PositionFix, stamp_ns: int) -> Verdict:
        if not is_position(fix.position_m, fix.covariance_m2):
            return Verdict(Source.UWB_POSE, 0, Reason.INVALID)
        R = symmetric(fix.covariance_m2) + np.eye(2) * self._s.position_sd_m**2
        if self._stamp_ns is None:
            self.begin(stamp_ns, fix.position_m, R, None)
            self._uwb_ns = stamp_ns
            return Verdict(Source.UWB_POSE, 0, Reason.ACCEPTED)
        innovation = fix.position_m - self._x[:2]
        R = self._noise(R, innovation, self._P[:2, :2])
        d2 = float(innovation @ np.linalg.solve(self._P[:2, :2] + R, innovation))
        details = (d2, self._gate, 2, float(np.linalg.norm(innovation)))
        if d2 > self._gate:
            if self._refused_since_ns is None:
                self._refused_since_ns = stamp_ns
            if stamp_ns - self._refused_since_ns < to_ns(self._s.reopen_s):
                return Verdict(Source.UWB_POSE, 0, Reason.GATE, *details)
            self.begin(stamp_ns, fix.position_m, R, None)
        else:
            H = np.zeros((2, 5))
            H[0, 0] = H[1, 1] = 1.0
            self._correct(innovation, H, R)
        self._refused_since_ns = None
        self._uwb_ns = stamp_ns
        return Verdict(Source.UWB_POSE, 0, Reason.ACCEPTED, *details)

    def _noise(self, R: Array, innovation: Array, P: Array) -> Array:  # noqa: ARG002
        """Covariance to use for a position that claims R, given its innovation and the state's P, all horizontal."""
        return R

    def _use_step(self, step: StepFix, stamp_ns: int) -> Verdict:
        if not is_step(step):
            return Verdict(Source.STEP, 0, Reason.INVALID)
        self._step_ns = stamp_ns
        if self._stamp_ns is None:
            return Verdict(Source.STEP, 0, Reason.NOT_INITIALISED)
        if not self._yaw_known:
            self._find_yaw(step)
            return Verdict(Source.STEP, 0, Reason.NOT_INITIALISED)
        if not 0.2 < step.interval_s < 2.0:
            return Verdict(Source.STEP, 0, Reason.ACCEPTED)
        speed = step.length_m / step.interval_s
        heading = step.heading_rad + self._x[4]
        along = np.array([math.cos(heading), math.sin(heading)])
        across = np.array([-along[1], along[0]])
        H = np.zeros((2, 5))
        H[0, 2] = H[1, 3] = 1.0
        H[:, 4] = -speed * across
        R = (
            np.outer(along, along) * step.length_variance_m2 / step.interval_s**2
            + np.outer(across, across) * speed**2 * min(step.heading_variance_rad2, math.pi**2)
            + np.eye(2) * self._s.step_velocity_sd_ms**2
        )
        self._correct(speed * along - self._x[2:4], H, R)
        return Verdict(Source.STEP, 0, Reason.ACCEPTED)

    def _find_yaw(self, step: StepFix) -> None:
        found = self._alignment.step(step.length_m, step.heading_rad, self._x[:2])
        if found is not None:
            self._x[4] = found[0]
            self._P[4, :] = self._P[:, 4] = 0.0
            self._P[4, 4] = found[1]
            self._yaw_known = True

    def _correct(self, innovation: Array, H: Array, R: Array) -> None:
        """Kalman update in Joseph's form, which keeps the covariance positive semi-definite."""
        K = np.linalg.solve(H @ self._P @ H.T + R, H @ self._P).T
        self._x = self._x + K @ innovation
        self._x[4] = math.remainder(self._x[4], 2.0 * math.pi)
        A = np.eye(5) - K @ H
        P = A @ self._P @ A.T + K @ R @ K.T
        self._P = (P + P.T) / 2.0
