"""The laboratory of trek1000_bielefeld: four anchors, a carried tag, Vicon truth on a clock and in a frame of its own.

    python bench/uwb_trek_lab.py

Offsets of the anchors, their height over the tag and the settings of the solvers are found on the one run and scored on
the other, after one time offset and one rigid alignment.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import least_squares
from uwb_solver_grid import candidates
from uwb_tracks import Array, MakeSolver, measurements_of, run_solver

from mine_loc_bringup.demo.trek_lab import LabRun, read
from mine_loc_core.alignment import align, truth_at
from mine_loc_core.site import load_site
from mine_loc_uwb.measurements import Measurements

RUNS = {"m1l": "m2r", "m2r": "m1l"}
"""Each run, and the one its constants come from."""
SITE = Path(__file__).parents[1] / "config" / "trek_lab"
ANCHORS_M = np.array([anchor.position_m for anchor in load_site(SITE).anchors])
GIVEN_SD_M = 0.08


def calibrate(run: LabRun) -> tuple[Array, float]:
    """Offset of each anchor [m] and height of the anchors over the tag [m], found with where the truth lies."""
    times_s = run.ms / 1e3

    def residual(p: Array) -> Array:
        yaw, shift, late_s, height_m, offset_m = p[0], p[1:3], p[3], p[4], p[5:]
        place = truth_at(times_s + late_s, run.truth.times_s, run.truth.positions_m[:, :2])
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        offset = (place @ turn.T + shift)[:, None] - ANCHORS_M[:, :2]
        distance = np.sqrt((offset**2).sum(axis=2) + height_m**2)
        return np.asarray(np.nan_to_num(run.ranges_m - distance - offset_m).ravel())

    starts = [np.array([np.pi, 2.5, 2.5, late_s, 1.0, *[0.3] * 4]) for late_s in (0.0, 2.0, 4.0)]
    found = min((least_squares(residual, start, loss="soft_l1", f_scale=0.1) for start in starts), key=lambda f: f.cost)
    return found.x[5:], float(found.x[4])


def rounds_of(run: LabRun, offset_m: Array, height_m: float) -> list[Measurements]:
    """Rounds in the plane of the tag."""
    anchors_m = ANCHORS_M + np.array([0.0, 0.0, height_m])
    return [
        measurements_of(1.0 + ms / 1e3, anchors_m, row - offset_m, sd_m=GIVEN_SD_M, height_m=0.0)
        for ms, row in zip(run.ms.tolist(), run.ranges_m, strict=True)
    ]


def score(make: MakeSolver, run: LabRun, rounds: list[Measurements]) -> dict[str, float]:
    """Of one solver on one run."""
    track = run_solver(make, rounds)
    truth_m = run.truth.positions_m[:, :2]
    found = align(track.times_s - 1.0, track.positions_m, run.truth.times_s, truth_m, search_s=10.0)
    truth_m = found.apply(truth_at(track.times_s - 1.0 + found.time_offset_s, run.truth.times_s, truth_m))
    error = np.linalg.norm(track.positions_m - truth_m, axis=1)
    return {
        "median_m": float(np.nanmedian(error)),
        "rmse_m": float(np.sqrt(np.nanmean(error**2))),
        "fix_share": len(track.times_s) / len(rounds),
    }


def run() -> dict[str, Any]:
    """All solvers on both runs."""
    recorded = {name: read(name) for name in RUNS}
    constants = {name: calibrate(recorded[name]) for name in RUNS}
    rounds = {name: rounds_of(recorded[name], *constants[RUNS[name]]) for name in RUNS}
    figures: dict[str, Any] = {name: {} for name in RUNS}
    for solver, makers in candidates().items():
        scores = {
            setting: {name: score(make, recorded[name], rounds[name]) for name in RUNS}
            for setting, make in makers.items()
        }
        for name, other in RUNS.items():
            best = min(scores, key=lambda setting: scores[setting][other]["rmse_m"])
            figures[name][solver] = scores[best][name] | {"chosen_on_the_other": best}
    return figures


if __name__ == "__main__":
    print(json.dumps(run(), indent=2))
