"""Proximity (paper C): 1 000 approaches past a vehicle, alarms by multilateration, by paper C's filter and by ours.

    python bench/fusion_proximity.py

`proximity`: six anchors on the walls of a place and independent NLOS spikes as paper C describes them. Beside it the
harder `obstacles`, the simulator's channel, where errors last as long as what causes them, and the same spikes with the
anchors on the vehicle itself, where they push positions away from it and hardly anything raises a false alarm.

Every method has the same rounds and as many bounds and dwells to choose from, on seeds of their own: that setting which
raises the fewest false alarms of those that miss nobody and warn no later than a point in the zone by multilateration
does without any hysteresis. `multilateration` and `weighted_lm_kf` judge the position alone, by its distance from the
zone, which they may enlarge; `mine_loc` the probability of being inside, from the tracker's covariance, and
`mine_loc_as_shipped` the same with the defaults of tracker and node, on which nothing was chosen here.
"""

import itertools
import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from fusion_proximity_walks import APPROACHES, DANGER, Channel, Place, Walks, walks
from scipy.stats import beta, chi2
from uwb_paper_c import GIVEN_SD_M, LAW, rounds_of
from uwb_tracks import Array, MakeSolver

from mine_loc_fusion.inside_probability import inside_probability
from mine_loc_fusion.proximity_parameters import ProximityParameters
from mine_loc_uwb.fix import FixStatus
from mine_loc_uwb.least_squares import LeastSquares
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.robust_tracker import RobustTracker
from mine_loc_uwb.tracker_settings import RobustTrackerSettings
from mine_loc_uwb.weighted_lm import WeightedLmFilter, WeightedLmSettings, weighted_lm

DWELLS_S = tuple(itertools.product((0.0, 0.5, 1.0), (0.0, 1.0)))  # before an alarm begins, and before it ends
MARGINS_M = tuple(
    (-outer, -outer - more) for outer in (-0.5, -0.25, -0.1, 0.0, 0.1, 0.25) for more in (0.001, 0.5)
)  # begins, ends: minus the distance from the zone
PROBABILITIES = tuple((enter, part * enter) for enter in (0.05, 0.1, 0.2, 0.3, 0.5, 0.7) for part in (0.2, 0.999))


@dataclass(frozen=True, slots=True)
class Rule:
    """An alarm begins when the score was at least `enter` for `enter_dwell_s`, and ends as a presence does."""

    enter: float
    leave: float
    enter_dwell_s: float
    leave_dwell_s: float


@dataclass(frozen=True, slots=True)
class Score:
    """What a rule makes of the walks: who was detected and how early [s] (NaN = not), false alarms and their time."""

    detected: Array
    lead_s: Array
    false_alarms: int
    hours: float


Judge = Callable[[Sequence[Measurements]], Array]
"""What says how far inside somebody is, a round: minus a distance [m], or a probability; NaN = nothing new."""


def by_multilateration(rounds: Sequence[Measurements]) -> Array:
    """Plain nonlinear least squares of each round from the last fix on; at first from the linear one."""
    last = None
    scores = np.full(len(rounds), np.nan)
    for number, measurements in enumerate(rounds):
        if last is None or len(measurements) < 3:
            fix = LeastSquares().solve(measurements).fix
            last = fix.position_m[:2].copy() if fix.status is FixStatus.OK else last
        if last is not None and len(measurements) >= 3:
            last = weighted_lm(
                last, measurements.anchors_m, measurements.range_m, np.ones(len(measurements)), measurements.plane_m
            )
            scores[number] = -DANGER.signed_distance_m(last[None])[0]
    return scores


def by_position(make: MakeSolver) -> Judge:
    """Distance of a solver's positions from the zone."""

    def judge(rounds: Sequence[Measurements]) -> Array:
        return np.array([-DANGER.signed_distance_m(mean_m[None])[0] for mean_m, _ in _fixes(make, rounds)])

    return judge


def by_probability(make: MakeSolver) -> Judge:
    """Probability of being inside, as the node `proximity` has it."""

    def judge(rounds: Sequence[Measurements]) -> Array:
        return np.array(
            [
                inside_probability(DANGER, mean_m, covariance_m2) if np.isfinite(mean_m).all() else np.nan
                for mean_m, covariance_m2 in _fixes(make, rounds)
            ]
        )

    return judge


def _fixes(make: MakeSolver, rounds: Sequence[Measurements]) -> Iterator[tuple[Array, Array]]:
    solver = make()
    for measurements in rounds:
        fix = solver.solve(measurements).fix
        good = fix.status is FixStatus.OK
        yield (fix.position_m[:2] if good else np.full(2, np.nan)), fix.covariance_m2[:2, :2]


def candidates() -> dict[str, tuple[dict[str, Judge], tuple[tuple[float, float], ...]]]:
    """Each method's settings by name, and its pairs of bounds; as many for both filters, each with all dwells."""
    lm, tracker = {}, {}
    for q, floor_m in itertools.product((0.2, 0.8), (0.02, 0.1)):
        lm[f"q={q} floor={floor_m}"] = by_position(_make(WeightedLmFilter, WeightedLmSettings(q, floor_m)))
    for q, share in itertools.product((0.1, 0.3), (0.2, 0.5)):
        settings = RobustTrackerSettings(acceleration_density_m2_s3=q, nlos_share=share)
        tracker[f"q={q} nlos_share={share}"] = by_probability(_make(RobustTracker, settings))
    return {
        "multilateration": ({"": by_multilateration}, MARGINS_M),
        "weighted_lm_kf": (lm, MARGINS_M),
        "mine_loc": (tracker, PROBABILITIES),
    }


def _make(kind: Callable[[Any], Any], settings: Any) -> MakeSolver:
    return lambda: kind(settings)


def judged(judge: Judge, those: Walks, sd_m: float) -> Array:
    """Scores (n, k) of all walks."""
    scores = np.full(those.times_s.shape, np.nan)
    for row, run in enumerate(those.runs):
        scores[row, : len(run.truth_m)] = judge(rounds_of(run, sd_m, those.anchors_m))
    return scores


def alarms(scores: Array, rule: Rule) -> Array:
    """Whether the alarm is on, (n, k): the rule of `mine_loc_fusion.presence`, for many walks at a time."""
    on, since = np.zeros(len(scores), bool), np.full(len(scores), -1)
    dwell = np.ceil(np.array([rule.enter_dwell_s, rule.leave_dwell_s]) / LAW["period_s"] - 1e-9).astype(int)
    states = np.zeros(scores.shape, bool)
    for number, score in enumerate(scores.T):
        told = np.isfinite(score)
        asks = np.where(on, score <= rule.leave, score >= rule.enter)
        since = np.where(told, np.where(asks, np.where(since < 0, number, since), -1), since)
        change = told & asks & (number - since >= np.where(on, dwell[1], dwell[0]))
        on, since = on ^ change, np.where(change, -1, since)
        states[:, number] = on
    return states


def score(states: Array, those: Walks) -> Score:
    """Count what the alarms were worth."""
    lead_s, false_alarms = [], 0
    for on, times_s, entered_s, left_s in zip(
        states & np.isfinite(those.times_s), those.times_s, those.entered_s, those.left_s, strict=True
    ):
        comes = math.isfinite(entered_s)
        early_s = math.nan
        for first, last in _episodes(on):
            if comes and times_s[last] >= entered_s - APPROACHES["early_s"] and times_s[first] <= left_s:
                hit = times_s[last] >= entered_s
                early_s = entered_s - times_s[first] if hit and math.isnan(early_s) else early_s
            else:
                false_alarms += 1
        if comes:
            lead_s.append(min(early_s, APPROACHES["early_s"]))
    leads = np.array(lead_s)
    hours = float((those.distance_m > 0.0).sum()) * LAW["period_s"] / 3600.0
    return Score(np.isfinite(leads), leads, false_alarms, hours)


def _episodes(on: Array) -> Iterator[tuple[int, int]]:
    """First and last round of each alarm."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], on.astype(int), [0]])))
    return zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True)


def chosen_rule(
    scores: Array, those: Walks, bounds: Sequence[tuple[float, float]], least_lead_s: float
) -> tuple[Any, ...]:
    """(missed, too late by, false alarms, minus the lead, rule) of the best rule on the tuning walks."""
    found = []
    for (enter, leave), (enter_dwell_s, leave_dwell_s) in itertools.product(bounds, DWELLS_S):
        rule = Rule(enter, leave, enter_dwell_s, leave_dwell_s)
        result = score(alarms(scores, rule), those)
        lead_s = float(np.nanmean(result.lead_s)) if result.detected.any() else -math.inf
        late_s = max(0.0, least_lead_s - lead_s)
        found.append((int((~result.detected).sum()), late_s, result.false_alarms, -lead_s, rule))
    return min(found, key=lambda each: each[:4])


def proximity_rows(place: Place = "loading_place", channel: Channel = "spikes") -> dict[str, Any]:
    """The rows of one channel, and what was chosen for them."""
    prefix = "" if (place, channel) == ("loading_place", "spikes") else "further_"
    tuning = walks(_seeds(f"{prefix}tuning_seeds"), place, channel)
    scored = walks(_seeds(f"{prefix}seeds"), place, channel)
    sd_m = GIVEN_SD_M[channel]
    plain = score(alarms(judged(by_multilateration, tuning, sd_m), Rule(0.0, -0.001, 0.0, 0.0)), tuning)
    least_lead_s = float(np.nanmean(plain.lead_s))
    rows: dict[str, Any] = {}
    results: dict[str, Score] = {}
    for method, (judges, bounds) in candidates().items():
        options = {
            name: chosen_rule(judged(judge, tuning, sd_m), tuning, bounds, least_lead_s)
            for name, judge in judges.items()
        }
        name = min(options, key=lambda each: options[each][:4])
        rule = options[name][-1]
        results[method] = score(alarms(judged(judges[name], scored, sd_m), rule), scored)
        rows[method] = _row(results[method]) | {"chosen": f"{name} {rule}".strip()}
    p = ProximityParameters()
    as_shipped = Rule(p.danger_enter, p.danger_leave, p.danger_dwell_s, p.leave_dwell_s)
    results["mine_loc_as_shipped"] = score(
        alarms(judged(by_probability(RobustTracker), scored, sd_m), as_shipped), scored
    )
    rows["mine_loc_as_shipped"] = _row(results["mine_loc_as_shipped"]) | {"chosen": str(as_shipped)}
    rows["false_alarms_over_multilateration"] = {
        method: result.false_alarms / max(results["multilateration"].false_alarms, 1)
        for method, result in results.items()
    }
    for method, result in results.items():
        rows[method]["lead_minus_multilateration_s"] = _mean(result.lead_s - results["multilateration"].lead_s)
    return rows


def _seeds(name: str) -> range:
    first, last = APPROACHES[name]
    return range(first, last + 1)


def _row(result: Score) -> dict[str, Any]:
    """Share, rate and lead, each with what it was counted from and its interval of 95 %."""
    hits, count = int(result.detected.sum()), len(result.detected)
    low = float(beta.ppf(0.025, hits, count - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.975, hits + 1, count - hits)) if hits < count else 1.0
    false = result.false_alarms
    rate = [
        0.5 * float(chi2.ppf(p, 2 * n)) / result.hours if n else 0.0 for p, n in ((0.025, false), (0.975, false + 1))
    ]
    return {
        "detected": hits / count,
        "detected_ci95": [low, high],
        "approaches": count,
        "false_alarms_per_h": false / result.hours,
        "false_alarms_per_h_ci95": rate,
        "false_alarms": false,
        "hours": result.hours,
        "lead_s": _mean(result.lead_s),
    }


def _mean(values: Array) -> dict[str, float]:
    good = values[np.isfinite(values)]
    half = 1.96 * float(np.std(good, ddof=1)) / math.sqrt(len(good))
    return {"mean": float(np.mean(good)), "ci95": half, "n": len(good)}


def run() -> dict[str, Any]:
    """The rows, and beside them the harder channel and the scene whose anchors ride on the vehicle."""
    return {
        "proximity": proximity_rows(),
        "proximity_obstacles": proximity_rows("loading_place", "obstacles"),
        "proximity_anchors_on_vehicle": proximity_rows("vehicle", "spikes"),
    }


if __name__ == "__main__":
    print(json.dumps(run(), indent=2))
