"""Loosely coupled fusion of solved positions with steps: an extended Kalman filter on (x, y, vx, vy, yaw offset).

Between measurements the velocity is driven by white acceleration and fades, so that a person nobody hears of is
expected to stay while the covariance grows. A step is a velocity measurement along its heading, turned by the yaw of
the odom frame in the map, which is first found by laying the dead-reckoned track over the positions.
"""

import copy
import math
from collections import deque

import numpy as np

from mine_loc_core.gates import chi2_quantile
from mine_loc_core.stamps import to_ns, to_s
from mine_loc_core.verdicts import Reason, Source, Verdict
from mine_loc_fusion.estimate import Array, EpochInputs, Estimate, Mode, PositionFix, StepFix
from mine_loc_fusion.parameters import FusionParameters

_VELOCITY_FADE_S = 3.0
_WALKING_SD_MS = 1.0  # prior of a person's velocity
_YAW_DRIFT_SD = math.radians(0.5)  # per square root of a second
_STEP_VELOCITY_SD_MS = 0.25  # the waist's speed varies within a step
_MIN_POSITION_SD_M = 0.05
_SHARED_BIAS_SD_M = (
    0.1  # ranges of one place share a bias that averaging does not remove: the least of several data sets
)
_YAW_BASELINE_M = 3.0
_MAX_PREDICTION_S = 600.0
_FARTHEST_M = 1e8  # beyond any map, grid coordinates included
_LARGEST_SD_M = 1e4  # a position that is no surer says nothing
_LONGEST_STEP_M = 5.0


class PoseFilter:
    """Estimator of one person (see `estimate.Estimator`)."""

    def __init__(self, parameters: FusionParameters) -> None:
        self._p = parameters
        self._gate = chi2_quantile(parameters.gate_probability, 2)
        self._stamp_ns: int | None = None
        self._x = np.zeros(5)
        self._P = np.eye(5)
        self._yaw_known = False
        self._uwb_ns: int | None = None
        self._step_ns: int | None = None
        self._refused_since_ns: int | None = None
        self._odom = np.zeros(2)
        self._pairs: deque[tuple[Array, Array]] = deque(maxlen=40)  # (odom position, position in the map)

    def update(self, inputs: EpochInputs) -> tuple[Verdict, ...]:
        """See Estimator."""
        if self._stamp_ns is not None:
            self._x, self._P = self._predicted(inputs.stamp_ns)
            self._stamp_ns = max(self._stamp_ns, inputs.stamp_ns)
        verdicts = [self._use_position(fix, inputs.stamp_ns) for fix in inputs.positions]
        verdicts += [self._use_step(step, inputs.stamp_ns) for step in inputs.steps]
        return tuple(verdicts)

    def estimate(self, stamp_ns: int) -> Estimate | None:
        """See Estimator."""
        if self._stamp_ns is None:
            return None
        x, P = self._predicted(stamp_ns)
        since_uwb_s = math.inf if self._uwb_ns is None else to_s(max(0, stamp_ns - self._uwb_ns))
        since_step_s = math.inf if self._step_ns is None else to_s(max(0, stamp_ns - self._step_ns))
        yaw = float(x[4]) if self._yaw_known else None
        covariance = P[:4, :4] + np.diag([_SHARED_BIAS_SD_M**2, _SHARED_BIAS_SD_M**2, 0.0, 0.0])
        mode = self._mode(covariance, since_uwb_s, since_step_s)
        return Estimate(stamp_ns, x[:2], x[2:4], covariance, mode, yaw, since_uwb_s, since_step_s)

    def save(self) -> dict[str, object]:
        """See Estimator."""
        return {name: copy.copy(value) for name, value in vars(self).items()}

    def restore(self, saved: dict[str, object]) -> None:
        """See Estimator."""
        vars(self).update({name: copy.copy(value) for name, value in saved.items()})

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
        rate = self._p.acceleration_sd**2  # of an Ornstein–Uhlenbeck velocity, per second
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
        R = fix.covariance_m2 + np.eye(2) * _MIN_POSITION_SD_M**2
        finite = np.abs(fix.position_m).max() < _FARTHEST_M and np.abs(R).max() < _LARGEST_SD_M**2  # false for NaN
        if not finite or np.linalg.eigvalsh(R + R.T)[0] <= 0.0:
            return Verdict(Source.UWB_POSE, 0, Reason.INVALID)
        R = (R + R.T) / 2.0
        if self._stamp_ns is None:
            self._begin(fix.position_m, R, stamp_ns)
            return Verdict(Source.UWB_POSE, 0, Reason.ACCEPTED)
        innovation = fix.position_m - self._x[:2]
        S = self._P[:2, :2] + R
        d2 = float(innovation @ np.linalg.solve(S, innovation))
        details = (d2, self._gate, 2, float(np.linalg.norm(innovation)))
        if d2 > self._gate:
            if self._refused_since_ns is None:
                self._refused_since_ns = stamp_ns
            if stamp_ns - self._refused_since_ns < to_ns(self._p.reopen_s):
                return Verdict(Source.UWB_POSE, 0, Reason.GATE, *details)
            self._begin(fix.position_m, R, stamp_ns)
        else:
            H = np.zeros((2, 5))
            H[0, 0] = H[1, 1] = 1.0
            self._correct(innovation, H, R)
        self._refused_since_ns = None
        self._uwb_ns = stamp_ns
        return Verdict(Source.UWB_POSE, 0, Reason.ACCEPTED, *details)

    def _begin(self, position_m: Array, R: Array, stamp_ns: int) -> None:
        """At the first position, and again where positions have disagreed for too long to be outliers."""
        yaw, yaw_variance = (self._x[4], self._P[4, 4]) if self._yaw_known else (0.0, math.pi**2)
        self._x = np.array([position_m[0], position_m[1], 0.0, 0.0, yaw])
        self._P = np.diag([0.0, 0.0, _WALKING_SD_MS**2, _WALKING_SD_MS**2, yaw_variance])
        self._P[:2, :2] = R
        self._stamp_ns = stamp_ns
        self._uwb_ns = stamp_ns
        self._pairs.clear()

    def _use_step(self, step: StepFix, stamp_ns: int) -> Verdict:
        variances = (step.length_variance_m2, step.heading_variance_rad2)
        if not (0.0 <= step.length_m < _LONGEST_STEP_M and math.isfinite(step.heading_rad)) or not all(
            0.0 <= variance < math.inf for variance in variances
        ):
            return Verdict(Source.STEP, 0, Reason.INVALID)
        self._odom = self._odom + step.length_m * np.array([math.cos(step.heading_rad), math.sin(step.heading_rad)])
        self._step_ns = stamp_ns
        if self._stamp_ns is None:
            return Verdict(Source.STEP, 0, Reason.NOT_INITIALISED)
        if not self._yaw_known:
            self._pairs.append((self._odom.copy(), self._x[:2].copy()))
            self._find_yaw()
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
            np.outer(along, along) * min(step.length_variance_m2, _LONGEST_STEP_M**2) / step.interval_s**2
            + np.outer(across, across) * speed**2 * min(step.heading_variance_rad2, math.pi**2)
            + np.eye(2) * _STEP_VELOCITY_SD_MS**2
        )
        self._correct(speed * along - self._x[2:4], H, R)
        return Verdict(Source.STEP, 0, Reason.ACCEPTED)

    def _find_yaw(self) -> None:
        """Yaw of the odom frame: the rotation that lays the dead-reckoned track over the positions (least squares)."""
        odom = np.array([pair[0] for pair in self._pairs])
        seen = np.array([pair[1] for pair in self._pairs])
        odom, seen = odom - odom.mean(axis=0), seen - seen.mean(axis=0)
        spread_m = math.sqrt(float(np.sum(odom**2)))
        if np.ptp(odom, axis=0).max() < _YAW_BASELINE_M:
            return
        dot = float(np.sum(odom * seen))
        cross = float(np.sum(odom[:, 0] * seen[:, 1] - odom[:, 1] * seen[:, 0]))
        residual = seen - np.hypot(dot, cross) / spread_m**2 * _turned(odom, math.atan2(cross, dot))
        sd_m = max(math.sqrt(float(np.mean(residual**2))), _MIN_POSITION_SD_M)
        self._x[4] = math.atan2(cross, dot)
        self._P[4, :] = self._P[:, 4] = 0.0
        self._P[4, 4] = (sd_m / spread_m) ** 2 + math.radians(5.0) ** 2
        self._yaw_known = True

    def _correct(self, innovation: Array, H: Array, R: Array) -> None:
        """Kalman update in Joseph's form, which keeps the covariance positive semi-definite."""
        K = np.linalg.solve(H @ self._P @ H.T + R, H @ self._P).T
        self._x = self._x + K @ innovation
        self._x[4] = math.remainder(self._x[4], 2.0 * math.pi)
        A = np.eye(5) - K @ H
        P = A @ self._P @ A.T + K @ R @ K.T
        self._P = (P + P.T) / 2.0

    def _mode(self, P: Array, since_uwb_s: float, since_step_s: float) -> Mode:
        if ce95_m(P[:2, :2]) > self._p.lost_ce95_m:
            return Mode.LOST
        stepping = self._yaw_known and since_step_s < self._p.step_timeout_s
        if since_uwb_s < self._p.uwb_timeout_s:
            return Mode.UWB_PDR if stepping else Mode.UWB_ONLY
        return Mode.DEAD_RECKONING if stepping else Mode.COASTING


def ce95_m(covariance_m2: Array) -> float:
    """Radius of the circle round the mean that holds a Gaussian (2, 2) with probability 0.95, from above.

    Exact for a circular distribution; for a long one the quantile of its longer axis, which is never less.
    """
    largest = float(np.linalg.eigvalsh(covariance_m2)[-1])
    return math.sqrt(max(largest, 0.0) * chi2_quantile(0.95, 2))


def _turned(points: Array, angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    turned: Array = points @ np.array([[c, s], [-s, c]])
    return turned
