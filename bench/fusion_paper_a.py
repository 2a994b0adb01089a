"""Paper A's comparison of fusions, on laps through committed scenes (bench/fusion_scenes).

    python bench/fusion_paper_a.py

All rows of a walk get the same rounds and steps, as live; the rivals the positions of paper A's least squares and the
mean judgement of the links behind each, `mine_loc` and `gtsam` the ranges. All begin at the known start of the walk.
Settings of the rivals are those that did best on the tuning seeds of each scene (bench/fusion_tuning.py).
"""

import json
import math
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np
from fusion_gtsam import GtsamSettings, run_gtsam
from fusion_runs import MakeEstimator, Run, run_estimator
from fusion_walks import SCENES, Walk, make_walk, scene, seeds
from uwb_tracks import Array

from mine_loc_fusion.adaptive_ekf import AdaptiveEkf
from mine_loc_fusion.ekf import Ekf, EkfSettings
from mine_loc_fusion.estimate import Estimator, PositionFix
from mine_loc_fusion.los_weighted import LosWeighted, LosWeightedSettings
from mine_loc_fusion.robust_kf import RobustKf
from mine_loc_fusion.tightly_coupled import TightlyCoupled
from mine_loc_uwb.fix import FixStatus
from mine_loc_uwb.least_squares import LeastSquares

SCENE_NAMES = ("single_lap", "two_blocked", "long_nlos")
HARDER = {"single_lap_waist": "single_lap"}
"""Scenes that nothing was fitted to, and those whose settings the rivals have there."""
CHOSEN = SCENES / "chosen.json"
_START_SD_M, _START_YAW_SD_RAD = 0.1, math.radians(2.0)


def rival(name: str, settings: Mapping[str, Any]) -> Estimator:
    """An estimator by the name of its row."""
    given = dict(settings)
    if name in ("los_weighted", "los_weighted_residual"):
        return LosWeighted(LosWeightedSettings(**given))
    if name == "robust_kf":
        trust = given.pop("trust")
        return RobustKf(EkfSettings(**given), trust)
    if name == "adaptive_ekf":
        memory = given.pop("memory")
        return AdaptiveEkf(EkfSettings(**given), memory)
    return Ekf(EkfSettings(**given))


def begun(estimator: Estimator, walk: Walk) -> Estimator:
    """At the known start."""
    yaw = walk.start_yaw_rad, _START_YAW_SD_RAD**2
    estimator.begin(walk.rounds[0].stamp_ns, walk.start_m, _START_SD_M**2 * np.eye(2), yaw)
    return estimator


def solved(walk: Walk) -> list[PositionFix | None]:
    """Paper A's positions of the rounds."""
    solver, found = LeastSquares(), []
    for measurements in walk.rounds:
        fix = solver.solve(measurements).fix
        los = float(np.nanmean(measurements.los_probability)) if len(measurements) else math.nan
        good = fix.status is FixStatus.OK
        found.append(PositionFix(fix.position_m[:2], fix.covariance_m2[:2, :2], los) if good else None)
    return found


def rows_of(name: str, walk: Walk, positions: list[PositionFix | None], settings: Mapping[str, Any]) -> Run:
    """The run of one row over one walk."""
    if name == "uwb":
        places = [np.full(2, np.nan) if fix is None else fix.position_m for fix in positions]
        spreads = [np.full((2, 2), np.nan) if fix is None else fix.covariance_m2 for fix in positions]
        return Run(np.array(places), np.array(spreads), math.nan)
    if name == "gtsam":
        return run_gtsam(walk, GtsamSettings(**settings))
    if name == "pdr":
        return run_estimator(lambda w: begun(LosWeighted(), w), walk, [None] * len(walk.rounds))
    if name in ("mine_loc", "mine_loc_map"):
        area = walk.area if name == "mine_loc_map" else None
        return run_estimator(lambda w: begun(TightlyCoupled(area=area), w), walk)
    make: MakeEstimator = lambda w: begun(rival(name, settings), w)  # noqa: E731
    return run_estimator(make, walk, positions)


def errors_m(walk: Walk, run: Run) -> Array:
    """Horizontal error of each round that has a position."""
    error = np.linalg.norm(run.position_m - walk.truth_m, axis=1)
    found: Array = error[np.isfinite(error)]
    return found


def nees(walk: Walk, run: Run) -> float:
    """Mean normalised estimation error squared, 2 degrees of freedom."""
    error = run.position_m - walk.truth_m
    known = np.isfinite(run.covariance_m2).all(axis=(1, 2)) & np.isfinite(error).all(axis=1)
    if not known.any():
        return math.nan
    return float(
        np.mean(np.einsum("ni,nij,nj->n", error[known], np.linalg.inv(run.covariance_m2[known]), error[known]))
    )


def chosen(scene_name: str) -> dict[str, dict[str, Any]]:
    """Settings of the rivals in a scene, as found on its tuning seeds."""
    content: dict[str, dict[str, dict[str, Any]]] = json.loads(CHOSEN.read_text("utf-8"))
    return content[scene_name]


@cache
def walk_of(scene_name: str, seed: int) -> Walk:
    """Walks are made once."""
    return make_walk(scene(scene_name), seed)


def scene_rows(scene_name: str, settings: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """All rows of a scene over its scored seeds."""
    mapped = ("mine_loc_map",) if "gallery_width_m" in scene(scene_name) else ()
    names = ("uwb", "pdr", *settings, "mine_loc", *mapped)
    found: dict[str, list[list[float]]] = {name: [] for name in names}
    for seed in seeds(scene(scene_name), "seeds"):
        walk = walk_of(scene_name, seed)
        positions = solved(walk)
        for name in names:
            run = rows_of(name, walk, positions, settings.get(name, {}))
            error = errors_m(walk, run)
            figures = [error.mean(), error.max(), np.quantile(error, 0.95), nees(walk, run), run.us_per_epoch]
            found[name].append([float(each) for each in figures])
    return {name: _row(np.array(table)) for name, table in found.items()}


def _row(table: Array) -> dict[str, float | int]:
    mean, largest, ce95, consistency = table[:, :4].mean(axis=0)
    mean_ci95, largest_ci95 = 1.96 * table[:, :2].std(axis=0, ddof=1) / math.sqrt(len(table))
    return {
        "mean_m": float(mean),
        "mean_ci95_m": float(mean_ci95),
        "max_m": float(largest),
        "max_ci95_m": float(largest_ci95),
        "ce95_m": float(ce95),
        "mean_nees": float(consistency),
        "us_per_epoch": float(np.median(table[:, 4])),
        "runs": len(table),
    }


def run() -> dict[str, Any]:
    """All scenes."""
    return {name: scene_rows(name, chosen(HARDER.get(name, name))) for name in (*SCENE_NAMES, *HARDER)}


if __name__ == "__main__":
    print(json.dumps(run(), indent=2))
