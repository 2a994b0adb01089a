"""Extended Kalman filter on time differences or ranges, and levels: the rival of paper D's particle filter.

The same state (p, v, a), motion and observations, with Gaussian noise. The offset that a blink's arrivals share is
a state without memory and of unlimited variance, so no node is the reference; a link's gate tests it against what all
others say.
"""

from dataclasses import dataclass

import numpy as np

from mine_loc_core.gates import chi2_quantile
from mine_loc_core.verdicts import Reason
from mine_loc_uwb.blink_likelihood import TdoaRssParameters
from mine_loc_uwb.constant_acceleration import noise_root, start_covariance, transition
from mine_loc_uwb.fix import Array, Fix, FixStatus
from mine_loc_uwb.late_arrival import LateArrival
from mine_loc_uwb.link_geometry import gdop, left_out
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.path_loss import PathLoss
from mine_loc_uwb.solver import Solution
from mine_loc_uwb.tdoa_rss import solve_blink

_OFFSET_VARIANCE_M2 = 1e6
_LEAST_RANGE_M = 0.1


@dataclass(frozen=True, slots=True)
class EkfParameters:
    """Noise in physical units; `path_loss` None = levels unused."""

    path_loss: PathLoss | None = None
    jerk_density_m2_s5: float = 0.1
    excess_sd_m: float = 0.0
    """What NLOS adds to the arrivals' own noise."""
    law: LateArrival | None = None
    """How late arrivals are by their level, of which mean and variance are used; None = not on average."""
    level_sd_db: float = 6.0
    speed_sd_m_s: float = 1.0
    acceleration_sd_m_s2: float = 0.5
    gate_probability: float = 0.9999
    silence_s: float = 5.0
    """After this long without a measurement used, begin anew."""
    contradiction_s: float = 1.0
    """After this long with some link always at the gate, begin anew where one blink allows it."""
    max_gdop: float = 10.0


class Ekf:
    """Track of one tag."""

    def __init__(self, parameters: EkfParameters) -> None:
        self.parameters = parameters
        self._gate = chi2_quantile(parameters.gate_probability, 1)
        self._state = np.empty(0)
        self._covariance = np.empty((0, 0))
        self._stamp_ns = self._used_ns = self._agreed_ns = 0

    def solve(self, measurements: Measurements) -> Solution:
        """See `Solver.solve`."""
        dimensions = 3 if measurements.height_m is None else 2
        now_ns, count = measurements.stamp_ns, len(measurements)
        if len(self._state) != 3 * dimensions or now_ns - self._used_ns > 1e9 * self.parameters.silence_s:
            self._state = np.empty(0)
            return self._begin(measurements, dimensions)
        if now_ns < self._stamp_ns:
            return Solution(
                self._fix(measurements, 0, np.nan), (Reason.BACKWARD,) * count, np.full(count, np.nan), np.nan
            )
        if now_ns - self._agreed_ns > 1e9 * self.parameters.contradiction_s:
            begun = self._begin(measurements, dimensions)
            if begun.fix.status is FixStatus.OK:
                return begun
        self._predict(1e-9 * (now_ns - self._stamp_ns), dimensions)
        self._stamp_ns = now_ns
        return self._update(measurements)

    def _begin(self, measurements: Measurements, dimensions: int) -> Solution:
        """Start at the position that one blink gives, if it does."""
        p = self.parameters
        fix, reason = solve_blink(
            measurements, TdoaRssParameters(p.path_loss, p.excess_sd_m, p.law, max_gdop=p.max_gdop)
        )
        if fix.status is FixStatus.OK:
            solved = fix.covariance_m2[:dimensions, :dimensions]
            self._state = np.append(fix.position_m[:dimensions], np.zeros(2 * dimensions))
            self._covariance = start_covariance(solved, p.speed_sd_m_s, p.acceleration_sd_m_s2)
            self._stamp_ns = self._used_ns = self._agreed_ns = measurements.stamp_ns
        count = len(measurements)
        return Solution(fix, (reason,) * count, np.full(count, np.nan), np.nan)

    def _predict(self, elapsed_s: float, dimensions: int) -> None:
        across = np.eye(dimensions)
        F = np.kron(transition(elapsed_s), across)
        root = noise_root(elapsed_s, self.parameters.jerk_density_m2_s5)
        self._state = F @ self._state
        self._covariance = F @ self._covariance @ F.T + np.kron(root @ root.T, across)

    def _update(self, measurements: Measurements) -> Solution:
        """Take what passes the gate, the worst link left out one at a time."""
        count = len(measurements)
        innovation, H, R = self._observe(measurements)
        used = np.flatnonzero(np.isfinite(innovation))
        mahalanobis_sq = np.full(len(innovation), np.nan)
        while len(used):
            expected = H[used] @ self._covariance @ H[used].T + R[np.ix_(used, used)]
            mahalanobis_sq[used] = left_out(innovation[used], expected) ** 2
            worst = int(mahalanobis_sq[used].argmax())
            if mahalanobis_sq[used[worst]] <= self._gate:
                break
            used = np.delete(used, worst)
        self._correct(innovation[used], H[used], R[np.ix_(used, used)])
        links = used[used < count]
        if len(links) > measurements.shared_offset:
            self._used_ns = measurements.stamp_ns
        if len(links) == count:
            self._agreed_ns = measurements.stamp_ns
        reasons = np.where(np.isin(np.arange(count), links), Reason.ACCEPTED, Reason.GATE)
        rms = float(np.sqrt(np.mean(innovation[links] ** 2))) if len(links) else np.nan
        fix = self._fix(measurements, len(links), rms)
        return Solution(fix, tuple(Reason(r) for r in reasons.tolist()), mahalanobis_sq[:count], self._gate)

    def _observe(self, measurements: Measurements) -> tuple[Array, Array, Array]:
        """Innovations of arrivals, then of levels, (2n,), NaN = no level; Jacobian (2n, 3d); noise (2n, 2n)."""
        p, count = self.parameters, len(measurements)
        dimensions = len(self._state) // 3
        since = measurements.since_s[:, None]
        place, speed, acceleration = self._state.reshape(3, dimensions)
        offset = np.zeros((count, 3))
        offset[:, :dimensions] = place + speed * since + 0.5 * acceleration * since**2
        if measurements.height_m is not None:
            offset[:, 2] = measurements.height_m
        offset -= measurements.anchors_m
        ranges_m = np.maximum(np.linalg.norm(offset, axis=1), _LEAST_RANGE_M)
        toward = (offset / ranges_m[:, None])[:, :dimensions]
        H = np.concatenate([toward, toward * since, 0.5 * toward * since**2], axis=1)
        R = np.zeros((2 * count, 2 * count))
        late, variance_m2 = measurements.range_m - ranges_m, measurements.variance_m2 + p.excess_sd_m**2
        if p.law is not None:
            expected_m, more_m2 = p.law.moments(measurements.receive_power_dbm)
            late, variance_m2 = late - expected_m, variance_m2 + more_m2
        R[:count, :count] = np.diag(variance_m2)
        if measurements.shared_offset:
            R[:count, :count] += _OFFSET_VARIANCE_M2
            late = late - late.mean() if count else late  # near zero, so that nothing is lost to rounding
        R[count:, count:] = p.level_sd_db**2 * np.eye(count)
        if p.path_loss is None:
            return np.append(late, np.full(count, np.nan)), np.concatenate([H, 0.0 * H]), R
        off_db = measurements.receive_power_dbm - p.path_loss.level_dbm(ranges_m)
        slopes = p.path_loss.slope_db_per_m(ranges_m)[:, None]
        return np.append(late, off_db), np.concatenate([H, slopes * H]), R

    def _correct(self, innovation: Array, H: Array, R: Array) -> None:
        """Update in Joseph's form, which keeps the covariance positive semidefinite."""
        if not len(innovation):
            return
        gain = np.linalg.solve(H @ self._covariance @ H.T + R, H @ self._covariance).T
        self._state = self._state + gain @ innovation
        left = np.eye(len(self._state)) - gain @ H
        covariance = left @ self._covariance @ left.T + gain @ R @ gain.T
        self._covariance = 0.5 * (covariance + covariance.T)

    def _fix(self, measurements: Measurements, used: int, rms_m: float) -> Fix:
        dimensions = len(self._state) // 3
        position_m, covariance = np.zeros(3), np.zeros((3, 3))
        position_m[:dimensions] = self._state[:dimensions]
        if measurements.height_m is not None:
            position_m[2] = measurements.height_m
        covariance[:dimensions, :dimensions] = self._covariance[:dimensions, :dimensions]
        spread = gdop(measurements.anchors_m, position_m, dimensions, shared_offset=measurements.shared_offset)
        return Fix(FixStatus.OK, position_m, covariance, dimensions, used, rms_m, spread)
