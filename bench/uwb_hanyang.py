"""Outdoor walks and drives of hanyang_outdoor_uwb: four anchors within 2 m, a tag out to 50 m, RTK truth.

    python bench/uwb_hanyang.py

Causal, ranges only. For each run all that is constant (anchor offsets, their growth with distance, height of the tag,
latency of the stamps, settings of the solvers) is found on the other three. The authors' tracks are scored alike.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from hanyang import RUNS, folder, timed_ranges
from numpy.typing import NDArray
from scipy.optimize import least_squares
from uwb_solver_grid import candidates
from uwb_tracks import Array, MakeSolver, Track, measurements_of, run_solver

from mine_loc_bringup.recordings.hanyang import run_folder
from mine_loc_core.alignment import truth_at
from mine_loc_uwb.measurements import Measurements

GIVEN_SD_M = 0.08
PUBLISHED_RMSE_M = {
    "LOS_A1": {"authors_ls": 1.04, "authors_eskf": 1.12},
    "LOS_B3": {"authors_ls": 0.52, "authors_eskf": 0.60},
    "NLOS_A1": {"authors_ls": 0.98, "authors_eskf": 0.94},
    "NLOS_B3": {"authors_ls": 0.64, "authors_eskf": 0.84},
}
_ROUND_S = 0.09
_NS = 1e-9


@dataclass(frozen=True, slots=True)
class Recorded:
    """Exchanges in order: instants (n,) [s] since truth began, number of the anchor (n,), its place (n, 3), range."""

    times_s: Array
    anchor: NDArray[np.int64]
    anchor_m: Array
    range_m: Array
    truth_times_s: Array
    truth_m: Array
    authors: Mapping[str, tuple[Array, Array]]
    """Their tracks: times and positions (m, 2)."""


@dataclass(frozen=True, slots=True)
class Constants:
    """What is calibrated: offset of each anchor [m], its growth a metre of distance, tag height, stamp latency."""

    offset_m: Array
    growth: float
    height_m: float
    latency_s: float

    def corrected(self, recorded: Recorded) -> Array:
        """Ranges without what is known of their bias."""
        return np.asarray((recorded.range_m - self.offset_m[recorded.anchor]) / (1.0 + self.growth))


def read(run: str) -> Recorded:
    """One run."""
    ranges = timed_ranges(run)
    order, start_ns = np.argsort(ranges.stamp_ns, kind="stable"), int(ranges.track_ns[0])
    authors = {}
    for name, file in (("authors_ls", "LS.csv"), ("authors_eskf", "ESKF.csv")):
        track = np.loadtxt(run_folder(folder(), run) / file, delimiter=",", skiprows=1)
        authors[name] = (track[:, 0] - start_ns) * _NS, track[:, 1:3]
    return Recorded(
        (ranges.stamp_ns[order] - start_ns) * _NS,
        ranges.anchor[order],
        ranges.anchor_m[order],
        ranges.range_m[order],
        (ranges.track_ns - start_ns) * _NS,
        ranges.track_m[:, :2],
        authors,
    )


def calibrate(runs: Sequence[Recorded]) -> Constants:
    """Constants that explain the ranges of runs best, each run counting alike, errors by a robust loss."""

    def residual(p: Array) -> Array:
        constants = Constants(p[:4], p[4], p[5], p[6])
        parts = []
        for run in runs:
            place = truth_at(run.times_s - constants.latency_s, run.truth_times_s, run.truth_m)
            place = np.column_stack([place, np.full(len(place), constants.height_m)])
            error = constants.corrected(run) - np.linalg.norm(place - run.anchor_m, axis=1)
            parts.append(np.nan_to_num(error) / np.sqrt(len(error)))
        return np.concatenate(parts) * 100.0

    start = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.15])
    found = least_squares(
        residual, start, loss="soft_l1", f_scale=0.05, diff_step=1e-3, x_scale=[0.1] * 4 + [0.01, 1, 0.1]
    )
    p = found.x
    return Constants(p[:4], float(p[4]), float(p[5]), float(p[6]))


def rounds_of(run: Recorded, constants: Constants) -> list[Measurements]:
    """Exchanges in rounds: a new one begins with an anchor that was heard already, or after its time is over."""
    range_m = constants.corrected(run)
    rounds, begin, seen = [], 0, set[int]()
    for number, (time_s, anchor) in enumerate(zip(run.times_s, run.anchor.tolist(), strict=True)):
        if anchor in seen or time_s - run.times_s[begin] > _ROUND_S:
            rounds.append(slice(begin, number))
            begin, seen = number, set()
        seen.add(anchor)
    rounds.append(slice(begin, len(run.times_s)))
    return [_round(run, part, range_m, constants) for part in rounds]


def _round(run: Recorded, part: slice, range_m: Array, constants: Constants) -> Measurements:
    last_s = run.times_s[part][-1]
    return measurements_of(
        1000.0 + last_s - constants.latency_s,
        run.anchor_m[part],
        range_m[part],
        sd_m=GIVEN_SD_M,
        height_m=constants.height_m,
        ids=run.anchor[part] + 1,
        since_s=run.times_s[part] - last_s,
    )


def rmse_m(run: Recorded, times_s: Array, positions_m: Array) -> float:
    """Horizontal RMSE over all instants that truth covers."""
    error = np.linalg.norm(positions_m - truth_at(times_s, run.truth_times_s, run.truth_m), axis=1)
    return float(np.sqrt(np.nanmean(error**2)))


def score(make: MakeSolver, run: Recorded, rounds: Sequence[Measurements]) -> dict[str, float]:
    """Of one solver on one run: error, and the share of rounds that have a fix."""
    track = run_solver(make, rounds)
    error = _errors(run, track)
    known = np.isfinite(error)
    claimed = np.trace(track.covariances_m2, axis1=1, axis2=2)
    return {
        "rmse_2d_m": float(np.sqrt(np.mean(error[known] ** 2))),
        "fix_share": len(track.times_s) / len(rounds),
        "claimed_rms_m": float(np.sqrt(np.mean(claimed[known]))),
    }


def _errors(run: Recorded, track: Track) -> Array:
    truth = truth_at(track.times_s - 1000.0, run.truth_times_s, run.truth_m)
    return np.asarray(np.linalg.norm(track.positions_m - truth, axis=1))


def run() -> dict[str, Any]:
    """All solvers on all runs, settings and constants from the other three."""
    recorded = {name: read(name) for name in RUNS}
    constants = {name: calibrate([recorded[other] for other in RUNS if other != name]) for name in RUNS}
    rounds = {name: rounds_of(recorded[name], constants[name]) for name in RUNS}
    figures: dict[str, Any] = {name: {} for name in RUNS}
    for solver, makers in candidates().items():
        scores = {
            setting: {name: score(make, recorded[name], rounds[name]) for name in RUNS}
            for setting, make in makers.items()
        }
        for name in RUNS:
            best = min(scores, key=lambda setting: sum(scores[setting][o]["rmse_2d_m"] for o in RUNS if o != name))
            figures[name][solver] = scores[best][name] | {"chosen_on_the_others": best}
    for name, one in recorded.items():
        for author, (times_s, positions_m) in one.authors.items():
            own, shifted = (rmse_m(one, times_s - late_s, positions_m) for late_s in (0.0, constants[name].latency_s))
            published = PUBLISHED_RMSE_M[name][author]
            figures[name][author] = {"rmse_2d_m": min(own, shifted), "published_rmse_2d_m": published}
        figures[name]["constants"] = {
            "offset_m": constants[name].offset_m.round(4).tolist(),
            "growth": constants[name].growth,
            "height_m": constants[name].height_m,
            "latency_s": constants[name].latency_s,
        }
    rows = [row for row in figures["LOS_A1"] if row != "constants"]
    figures["mean_rmse_2d_m"] = {
        row: float(np.mean([figures[name][row]["rmse_2d_m"] for name in RUNS])) for row in rows
    }
    return figures


if __name__ == "__main__":
    print(json.dumps(run(), indent=2))
