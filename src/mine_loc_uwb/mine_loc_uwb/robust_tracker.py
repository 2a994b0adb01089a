"""Our tracker, the default: ranges one by one at their own instants, biases of links on line, one-sided noise.

What a range may be wrong by is modelled, not cut off: white noise, a bias of each link and of the tag that changes
slowly, and an excess when the link is obstructed, believed as far as its own ranges or the classifier say so. A gate
refuses what even that does not explain. When most ranges are refused for a while, the tracker begins anew where they
agree, if more do than the place has coordinates and the person can have got there (else a cluster of wrong ranges would
capture it).
"""

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from mine_loc_core.gates import chi2_quantile
from mine_loc_core.stamps import NS_PER_S
from mine_loc_core.verdicts import Reason
from mine_loc_uwb import tracker_kernel as kernel
from mine_loc_uwb import tracker_round
from mine_loc_uwb.blink_likelihood import TdoaRssParameters
from mine_loc_uwb.consensus_fix import Consensus, consensus_fix
from mine_loc_uwb.fix import Array, Fix, FixStatus, no_fix
from mine_loc_uwb.late_arrival import LateArrival
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.solver import Solution
from mine_loc_uwb.tdoa_rss import solve_blink
from mine_loc_uwb.tracker_settings import RobustTrackerSettings

Ids = npt.NDArray[np.uint64]
Slots = npt.NDArray[np.int64]
_REASON = {
    kernel.ACCEPTED: Reason.ACCEPTED,
    kernel.TOO_LONG: Reason.GATE,
    kernel.TOO_SHORT: Reason.GATE,
    kernel.IMPOSSIBLE: Reason.KINEMATIC,
    kernel.CONTESTED: Reason.AMBIGUOUS,
}
_MOST_LINKS = 16
_LONGEST_DOUBT_STEP_S = 0.5
"""A silence is not doubt: one round after it adds no more than this."""
_COASTED_S, _WIDE_M = 1.0, 1.0
"""Fewer ranges than coordinates for so long, a spread of so much: distances are no longer linear over it."""


class RobustTracker:
    """Tracks one tag; see `Solver`.

    The state `x` and its covariance `P` are open to a caller who estimates more than ranges tell (`tracker_kernel` says
    where `own_states` of them stand) and who may correct both by other measurements.
    """

    def __init__(self, settings: RobustTrackerSettings | None = None, own_states: int = 0) -> None:
        self.believe(settings or RobustTrackerSettings())
        self._own_states = own_states
        self.x, self.P = np.empty(0), np.empty((0, 0))
        self.starts = 0
        """How often the track has begun anew."""
        self.dimensions = self.first_link = 0
        """How many coordinates a place has, and where the biases of links begin in the state."""
        self.motion_known = False
        """Whether the caller knows how the person moves: doubt about ranges then casts none on the place."""
        self._stamp_ns = self._round_ns = self._trusted_ns = 0
        self._doubt_s = 0.0
        self._slot: dict[int, int] = {}
        self._known = b"", np.empty(0, np.int64)
        self._link_nlos = np.empty(0)

    def believe(self, settings: RobustTrackerSettings) -> None:
        """Take other settings from now on."""
        self._settings = settings
        self._noise = settings.noise()
        self._gate = chi2_quantile(settings.gate, 1)

    def copy(self) -> "RobustTracker":
        """A tracker in the same state that goes its own way."""
        other = object.__new__(RobustTracker)  # a third of the time of copy.copy, once an epoch
        state = vars(other)
        state.update(vars(self))
        for name in ("x", "P", "_link_nlos", "_slot"):  # what changes in place
            state[name] = state[name].copy()
        return other

    @property
    def started(self) -> bool:
        """Whether there is a place."""
        return self.starts > 0

    def add_states(self, count: int) -> None:
        """Make room for more states of the caller, all 0, before those that are there."""
        own, size = 2 * self.dimensions + 1, len(self.x)
        old = np.r_[:own, own + count : size + count]
        x, P = np.zeros(size + count), np.zeros((size + count, size + count))
        x[old], P[np.ix_(old, old)] = self.x, self.P
        self.x, self.P = x, P
        self._own_states += count
        self.first_link += count

    def advance(self, stamp_ns: int) -> None:
        """Predict the state to an instant; to an earlier one than that of the state nothing changes."""
        gone_s = (stamp_ns - self._stamp_ns) / NS_PER_S
        if self.started and gone_s > 0.0:
            kernel.predict(self.x, self.P, self.dimensions, self.first_link, gone_s, self._noise)
            self._stamp_ns = stamp_ns

    def solve(self, measurements: Measurements) -> Solution:
        """See `Solver`."""
        gone_s = max(measurements.stamp_ns - self._round_ns, 0) / NS_PER_S
        if not self.started or gone_s > self._settings.restart_after_s:
            return self._begin(measurements)
        if (measurements.stamp_ns - self._trusted_ns) / NS_PER_S >= _COASTED_S:
            self.advance(measurements.stamp_ns)
            found = self._place_within_wide_spread(measurements)
            if found is not None:
                return self._begin_at(found, measurements)
        ahead_s = max(measurements.stamp_ns - self._stamp_ns, 0) / NS_PER_S
        slots = self._slots_of(measurements.anchor_ids)
        codes, deviances = np.empty(len(slots), np.int64), np.empty(len(slots))
        quality, claimed_m2 = np.empty(tracker_round.QUALITIES), np.zeros((3, 3))
        offset_unknown = int(measurements.shared_offset and len(slots) > 0)
        tracker_round.take_round(
            self.x, self.P, measurements.dimensions, self.first_link, measurements.anchors_m, slots,
            measurements.range_m, measurements.variance_m2, measurements.since_s, measurements.plane_m,
            measurements.los_probability, measurements.receive_power_dbm, self._link_nlos, ahead_s, gone_s,
            offset_unknown, self._gate, self._noise, codes, deviances, quality, claimed_m2,
        )  # fmt: skip
        self._stamp_ns = max(self._stamp_ns, measurements.stamp_ns)
        self._round_ns = measurements.stamp_ns
        reasons = tuple([_REASON[code] for code in codes.tolist()])
        used, rms, dilution, short, holding = quality.tolist()
        fix = self._fix(measurements, claimed_m2, int(used), rms, dilution)
        solution = Solution(fix, reasons, deviances, self._gate)
        refused, held = len(reasons) - used, holding > measurements.dimensions
        if not reasons:
            return solution
        if refused > used or (not held and (short or refused == used)):
            return self._doubt(measurements, solution, gone_s)
        self._doubt_s = 0.0
        if used >= measurements.dimensions:
            self._trusted_ns = measurements.stamp_ns
        return solution

    def _doubt(self, measurements: Measurements, solution: Solution, gone_s: float) -> Solution:
        """Doubt grows while most ranges are refused, or those that are too short and no more than hold the place.

        Hardly anything makes a range too short: it is the place that is wrong. In the end the tracker begins anew where
        ranges agree; where they do not, all that it claims is how far a person can have walked.
        """
        self._doubt_s += min(gone_s, _LONGEST_DOUBT_STEP_S)
        if self._doubt_s < self._settings.reopen_after_s:
            return solution
        found = self._agreed_place(measurements)
        if found is not None and self._can_be_at(found, measurements.stamp_ns):
            return self._begin_at(found, measurements)
        if not self.motion_known:
            solution = replace(solution, fix=self._widened(solution.fix))
        if found is None:
            return solution
        refused = Reason.CAPTURE_GUARD
        reasons = tuple(
            refused if agrees and reason is not Reason.ACCEPTED else reason
            for agrees, reason in zip(found.agreeing, solution.reasons, strict=True)
        )
        return replace(solution, reasons=reasons)

    def _widened(self, fix: Fix) -> Fix:
        """Let the spread be no less than a third of the way that can have been walked since the place was trusted."""
        d, covariance_m2 = fix.dimensions, fix.covariance_m2.copy()
        way_m = self._settings.top_speed_m_s * (self._stamp_ns - self._trusted_ns) / NS_PER_S
        for axis in range(d):
            self.P[axis, axis] = max(self.P[axis, axis], (way_m / 3.0) ** 2)
            self.P[d + axis, d + axis] = max(self.P[d + axis, d + axis], self._settings.first_speed_sd_m_s**2)
            covariance_m2[axis, axis] = max(covariance_m2[axis, axis], self.P[axis, axis])
        return replace(fix, covariance_m2=covariance_m2)

    def _place_within_wide_spread(self, measurements: Measurements) -> Consensus | None:
        """Where ranges agree, if that is within a spread from coasting that is better not linearised over."""
        d = measurements.dimensions
        variance = float(np.trace(self.P[:d, :d]))
        if len(measurements) <= d or variance <= _WIDE_M**2:
            return None
        found = self._agreed_place(measurements)
        if found is None:
            return None
        way_m = float(np.linalg.norm(found.position_m - self.x[:d]))
        reachable = self._can_be_at(found, measurements.stamp_ns)
        return found if reachable and way_m < 3.0 * math.sqrt(variance) else None

    def _agreed_place(self, measurements: Measurements) -> Consensus | None:
        """The one place where more ranges agree than its coordinates need: as many as those always agree somewhere."""
        found = self._consensus(measurements) if len(measurements) > measurements.dimensions else None
        unknowns = measurements.dimensions + measurements.shared_offset
        return None if found is None or found.ambiguous or found.agreeing.sum() <= unknowns else found

    def _can_be_at(self, found: Consensus, stamp_ns: int) -> bool:
        """Whether the person can have got there since ranges last held the place, or all have agreed on it for long."""
        gone_s = (stamp_ns - self._trusted_ns) / NS_PER_S
        d = len(found.position_m)
        sd_m = math.sqrt(np.trace(found.covariance_m2))
        way_m = float(np.linalg.norm(found.position_m - self.x[:d]))
        unanimous = len(found.agreeing) > d + 1 and bool(found.agreeing.all())
        return way_m <= self._settings.top_speed_m_s * gone_s + 2.0 * sd_m or (
            unanimous and self._doubt_s >= self._settings.guard_s
        )

    def _begin(self, measurements: Measurements) -> Solution:
        """Start from one round, if it determines a place well enough."""
        count, dimensions = len(measurements), measurements.dimensions
        unknown = np.full(count, math.nan)
        if count < dimensions + measurements.shared_offset:
            fix = no_fix(FixStatus.TOO_FEW_RANGES, dimensions)
            return Solution(fix, (Reason.NOT_INITIALISED,) * count, unknown, self._gate)
        found = self._consensus(measurements)
        if found is None or math.sqrt(np.trace(found.covariance_m2)) > self._settings.max_start_sd_m:
            fix = no_fix(FixStatus.DEGENERATE, dimensions)
            return Solution(fix, (Reason.DEGENERATE,) * count, unknown, self._gate)
        return self._begin_at(found, measurements)

    def _begin_at(self, found: Consensus, measurements: Measurements) -> Solution:
        """Start where ranges agree; of two places that are as good all are believed."""
        self.place(measurements.stamp_ns, found.position_m, found.covariance_m2)
        codes = np.where(found.agreeing | found.ambiguous, kernel.ACCEPTED, kernel.TOO_LONG)
        slots, d = self._slots_of(measurements.anchor_ids), measurements.dimensions
        quality, claimed_m2 = np.empty(tracker_round.QUALITIES), np.zeros((3, 3))
        unknown = np.full(len(codes), math.nan)
        tracker_round.judge_round(
            self.x, d, self.first_link, measurements.anchors_m, slots, measurements.range_m, measurements.since_s,
            measurements.plane_m, codes, unknown, quality,
        )  # fmt: skip
        tracker_round.claim(
            self.x, self.P, d, measurements.anchors_m, measurements.plane_m, codes, self._noise, claimed_m2
        )
        used, rms, dilution, *_ = quality.tolist()
        reasons = tuple([_REASON[code] for code in codes.tolist()])
        return Solution(self._fix(measurements, claimed_m2, int(used), rms, dilution), reasons, unknown, self._gate)

    def _consensus(self, measurements: Measurements) -> Consensus | None:
        if measurements.shared_offset:
            return self._blink_place(measurements)
        sd_m = math.hypot(math.sqrt(float(np.mean(measurements.variance_m2))), self._settings.bias_sd_m)
        return consensus_fix(
            measurements.anchors_m,
            measurements.range_m,
            range_sd_m=sd_m,
            nlos_scale_m=self._settings.nlos_scale_m,
            height_m=measurements.height_m,
        )

    def _blink_place(self, measurements: Measurements) -> Consensus | None:
        s = self._settings
        law = LateArrival(s.nlos_share, s.nlos_scale_m, s.nlos_growth_per_db)
        weight = min((s.path_loss.shadowing_db / s.level_sd_db) ** 2, 1.0) if s.path_loss else 1.0
        blink = TdoaRssParameters(s.path_loss, law=law, level_weight=weight, max_gdop=math.inf)
        fix, _ = solve_blink(measurements, blink)
        if fix.status is not FixStatus.OK:
            return None
        d = fix.dimensions
        everyone = np.ones(len(measurements), np.bool_)
        return Consensus(fix.position_m[:d], fix.covariance_m2[:d, :d], everyone, ambiguous=False)

    def place(self, stamp_ns: int, position_m: Array, covariance_m2: Array) -> None:
        """Begin at a place (d,), at rest, with nothing known of the links; the caller's states stay."""
        d, own = len(position_m), self._own_states
        before = slice(self.first_link - own, self.first_link)
        x, P = np.zeros(2 * d + 1 + own), np.zeros((2 * d + 1 + own, 2 * d + 1 + own))
        if self.started and own:
            x[-own:], P[-own:, -own:] = self.x[before], self.P[before, before]
        x[:d], P[:d, :d] = position_m, covariance_m2
        P[range(d, 2 * d), range(d, 2 * d)] = self._settings.first_speed_sd_m_s**2
        P[2 * d, 2 * d] = self._settings.common_bias_sd_m**2
        self.x, self.P = x, P
        self.dimensions, self.first_link = d, len(x)
        self._slot, self._known, self._link_nlos = {}, (b"", np.empty(0, np.int64)), np.empty(0)
        self._stamp_ns = self._round_ns = self._trusted_ns = stamp_ns
        self._doubt_s = 0.0
        self.starts += 1

    def _slots_of(self, anchor_ids: Ids) -> Slots:
        """Place of each link's bias in the state; the same anchors as last time are the usual case."""
        key = anchor_ids.tobytes()
        if key != self._known[0]:
            self._known = key, np.array([self._slot_of(anchor) for anchor in anchor_ids.tolist()], np.int64)
        return self._known[1]

    def _slot_of(self, anchor_id: int) -> int:
        """A new link takes a new place, or the place of the one that was used longest ago."""
        slot = self._slot.pop(anchor_id, None)
        if slot is None:
            if len(self._slot) < _MOST_LINKS:
                slot = len(self._slot)
                self.x, self.P = np.append(self.x, 0.0), np.pad(self.P, ((0, 1), (0, 1)))
                self._link_nlos = np.append(self._link_nlos, 0.0)
            else:
                slot = self._slot.pop(next(iter(self._slot)))
            bias = self.first_link + slot
            self.x[bias], self.P[bias], self.P[:, bias] = 0.0, 0.0, 0.0
            self.P[bias, bias], self._link_nlos[slot] = self._settings.bias_sd_m**2, self._settings.nlos_share
        self._slot[anchor_id] = slot
        return slot

    def _fix(self, measurements: Measurements, claimed_m2: Array, used: int, rms_m: float, dilution: float) -> Fix:
        position = self.x[:3].copy()
        if measurements.height_m is not None:
            position[2] = measurements.height_m
        return Fix(FixStatus.OK, position, claimed_m2, measurements.dimensions, used, rms_m, dilution)
