"""Chooses what paper D's solvers are given, on walks that are never scored: writes uwb_scenes/paper_d.json.

    python bench/uwb_paper_d_tuning.py

Path loss and arrival variance of each channel are measured on the tuning walks. Every tuned solver then gets the same
number of random draws of its parameters from wide physical bounds, on the same walks, and keeps the draw with the least
geometric mean over the scenes of its mean error.
"""

import argparse
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track
from uwb_paper_d_score import held_error_m, positions_m
from uwb_paper_d_walks import SCENES, Channel, Walk, paper_d_runs, walks

from mine_loc_uwb.blink_likelihood import TdoaRssParameters
from mine_loc_uwb.ekf import Ekf, EkfParameters
from mine_loc_uwb.late_arrival import LateArrival
from mine_loc_uwb.particle_filter import ParticleFilter, ParticleFilterParameters
from mine_loc_uwb.path_loss import PathLoss, fit_path_loss
from mine_loc_uwb.robust_tracker import RobustTracker
from mine_loc_uwb.solver import Solver
from mine_loc_uwb.tdoa_rss import TdoaRss
from mine_loc_uwb.tracker_settings import RobustTrackerSettings

CHOSEN = Path(__file__).parent / "uwb_scenes" / "paper_d.json"
TUNING_SEEDS = range(1000, 1010)
DRAWS = 32
BOUNDS = {
    "jerk_density_m2_s5": (1e-3, 1.0),
    "acceleration_density_m2_s3": (1e-3, 1.0),
    "level_sd_db": (5.0, 100.0),
    "excess_sd_m": (0.5, 6.0),
    "core_sd_m": (0.2, 1.5),
    "delay_m": (0.1, 4.0),
    "growth_per_db": (0.05, 0.35),
    "level_weight": (0.01, 1.0),
}
"""Drawn log-uniformly. Jerk has a lower bound because a straight line at constant speed would want none."""
_EKF = ("jerk_density_m2_s5", "level_sd_db", "excess_sd_m")
_LAW = ("core_sd_m", "delay_m")
TUNED: dict[str, tuple[str, ...]] = {
    "ekf_tuned": _EKF,
    "ekf_by_level": (*_EKF, "delay_m", "growth_per_db"),
    "pf_fixed_law": ("jerk_density_m2_s5", "level_sd_db", *_LAW),
    "pf": ("jerk_density_m2_s5", "level_sd_db", *_LAW, "growth_per_db"),
    "robust_tracker": ("acceleration_density_m2_s3", "level_sd_db", *_LAW, "growth_per_db"),
    "tdoa_rss": ("level_weight", "excess_sd_m", "delay_m", "growth_per_db"),
}


def law_of(drawn: Mapping[str, float]) -> LateArrival | None:
    """The law of lateness among drawn parameters, if there is one; every arrival through CM8 is late."""
    if "delay_m" not in drawn:
        return None
    return LateArrival(1.0, drawn["delay_m"], drawn.get("growth_per_db", 0.0))


def build(name: str, path_loss: PathLoss, drawn: Mapping[str, float]) -> Solver:
    """Make a solver of TUNED with these parameters."""
    rest = {key: value for key, value in drawn.items() if key not in {"delay_m", "growth_per_db"}}
    law = law_of(drawn)
    if name == "tdoa_rss":
        return TdoaRss(TdoaRssParameters(path_loss, law=law, **rest))
    if name.startswith("ekf"):
        return Ekf(EkfParameters(path_loss, law=law, **rest))
    assert law is not None
    if name == "robust_tracker":
        return RobustTracker(tracker_settings(path_loss, law, **rest))
    return ParticleFilter(ParticleFilterParameters(path_loss, law=law, **rest))


def tracker_settings(
    path_loss: PathLoss,
    law: LateArrival,
    acceleration_density_m2_s3: float,
    level_sd_db: float,
    core_sd_m: float,
) -> RobustTrackerSettings:
    """Of the robust tracker: every link obstructed, its bias the law's core, which changes from blink to blink."""
    return RobustTrackerSettings(
        acceleration_density_m2_s3=acceleration_density_m2_s3,
        bias_sd_m=core_sd_m,
        bias_time_s=0.5,
        nlos_scale_m=law.delay_m,
        nlos_growth_per_db=law.growth_per_db,
        nlos_time_s=0.05,
        nlos_share=0.97,
        path_loss=path_loss,
        level_sd_db=level_sd_db,
        max_start_sd_m=50.0,
    )


def measured(channel: Channel) -> dict[str, Any]:
    """Path loss and true standard deviation of arrivals of a channel, over both scenes."""
    ranges, levels, errors = [], [], []
    for scene in SCENES:
        for walk in walks(scene, channel, TUNING_SEEDS):
            ranges.append(np.linalg.norm(walk.truth_m[:, None] - walk.anchors_m, axis=2))
            levels.append(walk.level_dbm)
            errors.append(walk.late_m)
    fit = fit_path_loss(np.concatenate(ranges).ravel(), np.concatenate(levels).ravel())
    loss = [fit.level_1m_dbm, fit.exponent, fit.shadowing_db]
    return {"path_loss": loss, "arrival_sd_m": float(np.nanstd(np.concatenate(errors)))}


def search(name: str, path_loss: PathLoss, tuning: Mapping[str, list[Walk]]) -> dict[str, float]:
    """Best of the draws of one solver."""
    rng = np.random.default_rng(7)
    draws = []
    for _ in range(DRAWS):
        bounds = {key: BOUNDS[key] for key in TUNED[name]}
        draws.append({key: float(np.exp(rng.uniform(*np.log(limits)))) for key, limits in bounds.items()})
    costs = [
        cost(lambda drawn=drawn: build(name, path_loss, drawn), tuning)  # type: ignore[misc]
        for drawn in track(draws, description=f"{name:14}")
    ]
    return draws[int(np.argmin(costs))]


def cost(make: Callable[[], Solver], tuning: Mapping[str, list[Walk]]) -> float:
    """Mean over the scenes of the logarithm of the mean error."""
    means = [np.mean([held_error_m(positions_m(make(), walk), walk) for walk in each]) for each in tuning.values()]
    return float(np.mean(np.log(means)))


def main() -> None:
    """Measure and search."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=TUNED, default=TUNED, help="solvers to choose for (default all)")
    only = parser.parse_args().only
    chosen: dict[str, Any] = json.loads(CHOSEN.read_text("utf-8")) if CHOSEN.exists() else {}
    for channel in ("cm7", "cm8"):
        chosen[channel] = chosen.get(channel, {}) | measured(channel)  # type: ignore[arg-type]
    path_loss = PathLoss(*chosen["cm8"]["path_loss"])
    tuning = {scene: [paper_d_runs(scene, "cm8", seed) for seed in TUNING_SEEDS] for scene in SCENES}
    for name in only:
        chosen["cm8"][name] = search(name, path_loss, tuning)
        CHOSEN.write_text(json.dumps(chosen, indent=2) + "\n", "utf-8")
    print(f"written: {CHOSEN}")


if __name__ == "__main__":
    main()
