"""Particle filter on time differences or ranges, and levels (paper D, eq. 7–13).

State (p, v, a); weights by the product over nodes of the likelihoods of arrival and level, arrivals being on time or
late (`late_arrival`), levels normal about the path loss [dB]; systematic resampling when the effective number of
particles falls under a share of all, in the midst of an update too, the rest of which the new particles then take
(progressive correction, Oudjane and Musso 2000); the estimate is their weighted mean. Resampled particles are spread by
a kernel that keeps their mean and covariance (Liu and West 2001): a walk's own noise is too small to part copies.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.gates import chi2_quantile
from mine_loc_core.verdicts import Reason
from mine_loc_uwb.blink_likelihood import TdoaRssParameters
from mine_loc_uwb.constant_acceleration import noise_root, start_covariance, transition
from mine_loc_uwb.fix import Array, Fix, FixStatus, no_fix
from mine_loc_uwb.late_arrival import LateArrival
from mine_loc_uwb.link_geometry import gdop, left_out
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.path_loss import PathLoss
from mine_loc_uwb.solver import Solution
from mine_loc_uwb.tdoa_rss import solve_blink

_OFFSET_VARIANCE_M2 = 1e6
_HULL_MARGIN_M = 5.0
_LEAST_RANGE_M = 0.1
_MOST_STAGES, _HALVINGS = 12, 8


@dataclass(frozen=True, slots=True)
class ParticleFilterParameters:
    """Noise in physical units; `path_loss` None = levels unused."""

    path_loss: PathLoss | None = None
    jerk_density_m2_s5: float = 0.1
    core_sd_m: float = 0.1
    """Of arrivals on time, beyond their own noise."""
    law: LateArrival = field(default_factory=LateArrival)
    level_sd_db: float = 6.0
    speed_sd_m_s: float = 1.0
    acceleration_sd_m_s2: float = 0.5
    gate_probability: float = 0.9999
    """Of arrivals earlier than the others by more than this; late ones are the law's own business."""
    silence_s: float = 5.0
    """After this long without a measurement used, begin anew."""
    contradiction_s: float = 1.0
    """After this long with some link always at the gate, begin anew where one blink allows it."""
    max_gdop: float = 10.0
    particles: int = 1000
    resampling_share: float = 0.5
    seed: int = 1


class ParticleFilter:
    """Track of one tag. Same seed and same measurements, same results."""

    def __init__(self, parameters: ParticleFilterParameters) -> None:
        self.parameters = parameters
        self._gate = chi2_quantile(parameters.gate_probability, 1)
        self._rng = np.random.default_rng(parameters.seed)
        self._particles = np.empty((0, 0, 3))  # (N, d, [p v a])
        self._weights = np.full(parameters.particles, 1.0 / parameters.particles)
        self._stamp_ns = self._used_ns = self._agreed_ns = 0
        self._settled = False

    def solve(self, measurements: Measurements) -> Solution:
        """See `Solver.solve`."""
        p, now_ns, count = self.parameters, measurements.stamp_ns, len(measurements)
        dimensions = 3 if measurements.height_m is None else 2
        if self._particles.shape[1] != dimensions or now_ns - self._used_ns > 1e9 * p.silence_s:
            return self._begin(measurements, dimensions)
        if now_ns < self._stamp_ns:
            return self._unused(self._fix(measurements, 0), count, Reason.BACKWARD)
        if now_ns - self._agreed_ns > 1e9 * p.contradiction_s:
            fix = self._one_blink(measurements)
            if fix.status is FixStatus.OK:
                self._begin_at(fix, measurements)
                return self._unused(fix, count, Reason.ACCEPTED)
        elapsed_s = 1e-9 * (now_ns - self._stamp_ns)
        drawn = self._rng.standard_normal(self._particles.shape)
        self._particles = self._particles @ transition(elapsed_s).T
        self._particles += drawn @ noise_root(elapsed_s, p.jerk_density_m2_s5).T
        self._stamp_ns = now_ns
        return self._update(measurements)

    def _begin(self, measurements: Measurements, dimensions: int) -> Solution:
        """Start at the position that one blink gives, else anywhere among its nodes."""
        p, count = self.parameters, len(measurements)
        if count <= measurements.shared_offset:
            self._particles = np.empty((0, 0, 3))
            return self._unused(no_fix(FixStatus.TOO_FEW_RANGES, dimensions), count, Reason.NOT_INITIALISED)
        fix = self._one_blink(measurements)
        if fix.status is FixStatus.OK:
            self._begin_at(fix, measurements)
            return self._unused(fix, count, Reason.ACCEPTED)
        nodes_m = measurements.anchors_m[:, :dimensions]
        low, high = nodes_m.min(axis=0) - _HULL_MARGIN_M, nodes_m.max(axis=0) + _HULL_MARGIN_M
        self._particles = self._rng.standard_normal((p.particles, dimensions, 3))
        self._particles *= [0.0, p.speed_sd_m_s, p.acceleration_sd_m_s2]
        self._particles[:, :, 0] = self._rng.uniform(low, high, (p.particles, dimensions))
        self._started(measurements.stamp_ns, settled=False)
        return self._update(measurements)

    def _one_blink(self, measurements: Measurements) -> Fix:
        p = self.parameters
        return solve_blink(measurements, TdoaRssParameters(p.path_loss, p.core_sd_m, p.law, max_gdop=p.max_gdop))[0]

    def _begin_at(self, fix: Fix, measurements: Measurements) -> None:
        p, d = self.parameters, fix.dimensions
        covariance = start_covariance(fix.covariance_m2[:d, :d], p.speed_sd_m_s, p.acceleration_sd_m_s2)
        drawn = self._rng.standard_normal((p.particles, 3 * d)) @ np.linalg.cholesky(covariance).T
        self._particles = drawn.reshape(p.particles, 3, d).transpose(0, 2, 1).copy()
        self._particles[:, :, 0] += fix.position_m[:d]
        self._started(measurements.stamp_ns, settled=True)

    def _started(self, stamp_ns: int, *, settled: bool) -> None:
        self._weights[:] = 1.0 / len(self._weights)
        self._stamp_ns = self._used_ns = self._agreed_ns = stamp_ns
        self._settled = settled

    def _unused(self, fix: Fix, count: int, reason: Reason) -> Solution:
        """What is said without a prediction to compare with."""
        return Solution(fix, (reason,) * count, np.full(count, np.nan), self._gate)

    def _update(self, measurements: Measurements) -> Solution:
        p = self.parameters
        ranges_m = self._ranges_m(measurements)
        late_m = measurements.range_m - ranges_m
        sd_m = np.sqrt(measurements.variance_m2 + p.core_sd_m**2)
        delayed_m, more_m2 = p.law.moments(measurements.receive_power_dbm)
        shared = measurements.shared_offset
        used, mahalanobis_sq = self._not_early(late_m - delayed_m, sd_m**2 + more_m2, shared_offset=shared)
        remaining = 1.0
        for _ in range(_MOST_STAGES):
            taken = self._take(self._log_likelihood(measurements, used), remaining)
            remaining -= taken
            if remaining <= 0.0:
                break
            self._resample()
        if used.sum() > shared:
            self._used_ns = measurements.stamp_ns
        if used.all():
            self._agreed_ns = measurements.stamp_ns
        fix = self._fix(measurements, int(used.sum()))
        taken_for = Reason.ACCEPTED if fix.status is FixStatus.OK else Reason.DEGENERATE
        reasons = tuple(taken_for if each else Reason.GATE for each in used.tolist())
        return Solution(fix, reasons, mahalanobis_sq, self._gate)

    def _log_likelihood(self, measurements: Measurements, used: NDArray[np.bool_]) -> Array:
        """Of each particle (N,), arrivals as far as used."""
        p, ranges_m = self.parameters, self._ranges_m(measurements)
        levels = measurements.receive_power_dbm
        sd_m = np.sqrt(measurements.variance_m2[used] + p.core_sd_m**2)
        late_m, delay_m = measurements.range_m[used] - ranges_m[:, used], p.law.delays_m(levels[used])
        likelihood = p.law.log_likelihood(late_m, sd_m, delay_m, shared_offset=measurements.shared_offset)
        if p.path_loss is not None:
            off_db = levels - p.path_loss.level_dbm(ranges_m)
            likelihood -= 0.5 * np.nansum((off_db / p.level_sd_db) ** 2, axis=1)
        return likelihood

    def _take(self, log_likelihood: Array, most: float) -> float:
        """Weigh by the likelihood to the largest power up to `most` that leaves enough particles; returns the power."""
        log_likelihood = log_likelihood - log_likelihood.max()
        enough = self.parameters.resampling_share * len(self._weights)

        def weighed(power: float) -> Array:
            weights = self._weights * np.exp(power * log_likelihood)
            return np.asarray(weights / weights.sum())

        low, high = 0.0, most
        if 1.0 / np.sum(weighed(most) ** 2) >= enough:
            low = most
        for _ in range(_HALVINGS if low < most else 0):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if 1.0 / np.sum(weighed(middle) ** 2) >= enough else (low, middle)
        self._weights = weighed(low)
        return low

    def _arrival_sd_m(self) -> float:
        p = self.parameters
        return float(np.sqrt(p.core_sd_m**2 + p.law.moments(np.array(np.nan))[1]))

    def _ranges_m(self, measurements: Measurements) -> Array:
        """Ranges (N, n) that each particle supposes at the instant of each exchange."""
        squares = np.zeros((len(self._particles), len(measurements)))
        since = measurements.since_s
        moments = np.stack([np.ones_like(since), since, 0.5 * since**2])
        for axis in range(self._particles.shape[1]):
            squares += (self._particles[:, axis] @ moments - measurements.anchors_m[:, axis]) ** 2
        if measurements.height_m is not None:
            squares += (measurements.height_m - measurements.anchors_m[:, 2]) ** 2
        return np.sqrt(np.maximum(squares, _LEAST_RANGE_M**2))

    def _not_early(self, late_m: Array, variance_m2: Array, *, shared_offset: bool) -> tuple[NDArray[np.bool_], Array]:
        """Which arrivals (n,) are not earlier than the others allow, and their squared normal scores."""
        used = np.ones(len(variance_m2), bool)
        mahalanobis_sq = np.full(len(variance_m2), np.nan)
        mean = self._weights @ late_m
        spread = (self._weights[:, None] * (late_m - mean)).T @ (late_m - mean)
        spread += np.diag(variance_m2)
        if shared_offset and used.any():
            mean = mean - mean.mean()
            spread += _OFFSET_VARIANCE_M2
        while used.sum() > shared_offset:
            score = left_out(mean[used], spread[np.ix_(used, used)])
            mahalanobis_sq[used] = score**2
            worst = int(np.abs(score).argmax())
            if score[worst] >= 0.0 or score[worst] ** 2 <= self._gate:
                break
            used[np.flatnonzero(used)[worst]] = False
        return used, mahalanobis_sq

    def _resample(self) -> None:
        """Draw systematically, then spread copies by a kernel shrunk towards the mean."""
        count = len(self._weights)
        flat = self._particles.reshape(count, -1)
        mean = self._weights @ flat
        spread = (self._weights[:, None] * (flat - mean)).T @ (flat - mean)
        positions = (self._rng.random() + np.arange(count)) / count
        chosen = np.minimum(np.searchsorted(np.cumsum(self._weights), positions), count - 1)
        size = flat.shape[1]
        width = (4.0 / ((size + 2.0) * count)) ** (1.0 / (size + 4.0))  # Silverman's, best for normal spreads
        values, vectors = np.linalg.eigh(spread)
        root = vectors * (width * np.sqrt(np.maximum(values, 0.0)))
        kept = np.sqrt(1.0 - width**2) * (flat[chosen] - mean)
        drawn = self._rng.standard_normal(flat.shape) @ root.T
        self._particles = (mean + kept + drawn).reshape(self._particles.shape)
        self._weights[:] = 1.0 / count

    def _fix(self, measurements: Measurements, used: int) -> Fix:
        p, places = self.parameters, self._particles[:, :, 0]
        dimensions = places.shape[1]
        mean = self._weights @ places
        position_m, covariance = np.zeros(3), np.zeros((3, 3))
        position_m[:dimensions] = mean
        covariance[:dimensions, :dimensions] = (self._weights[:, None] * (places - mean)).T @ (places - mean)
        if measurements.height_m is not None:
            position_m[2] = measurements.height_m
        spread = gdop(measurements.anchors_m, position_m, dimensions, shared_offset=measurements.shared_offset)
        limit_m = p.max_gdop * self._arrival_sd_m()
        self._settled = self._settled or float(np.trace(covariance)) <= limit_m**2
        if not self._settled:
            return no_fix(FixStatus.DEGENERATE, dimensions, spread)
        residual = measurements.range_m - np.linalg.norm(position_m - measurements.anchors_m, axis=1)
        if measurements.shared_offset and len(residual):
            residual -= residual.mean()
        rms_m = float(np.sqrt(np.mean(residual**2))) if len(residual) else np.nan
        return Fix(FixStatus.OK, position_m, covariance, dimensions, used, rms_m, spread)
