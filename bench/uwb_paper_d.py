"""Paper D: TDOA, TDOA/RSS, Kalman and particle filter through CM7 and CM8, and public libraries beside them.

    python bench/uwb_paper_d.py [--seeds N]

Three nodes, 1 m/s on a straight line, 20 Hz, in two scenes (uwb_scenes/). What the solvers are given was measured or
chosen on other seeds (uwb_paper_d_tuning.py). Figures: mean horizontal error of each walk, then mean and standard
deviation over walks. A filter without a position is scored where its last one was, before the first at the middle of
the nodes. `tdoa` and `tdoa_rss`, which know no motion, and the two filters in CM7 are scored over the blinks for which
both have a position.
"""

import argparse
import json
from collections.abc import Callable, Mapping
from time import perf_counter
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import Progress
from rich.table import Table
from uwb_paper_d_peers import PEERS, run_peer
from uwb_paper_d_score import Reals, error_m, held_error_m
from uwb_paper_d_tuning import CHOSEN, build
from uwb_paper_d_walks import SCENES, Scene, Walk, paper_d_runs

from mine_loc_uwb.blink_likelihood import TdoaRssParameters
from mine_loc_uwb.ekf import Ekf, EkfParameters
from mine_loc_uwb.late_arrival import LateArrival
from mine_loc_uwb.particle_filter import ParticleFilter, ParticleFilterParameters
from mine_loc_uwb.path_loss import PathLoss
from mine_loc_uwb.solver import Solver
from mine_loc_uwb.tdoa_rss import TdoaRss

SEEDS = range(101, 151)
"""Looked at by nothing else: neither by the tuning (from 1000 on) nor while the solvers were written (below 100)."""
NOMINAL_JERK_M2_S5 = 0.1
"""Where nothing is tuned: a person's acceleration wanders by 0.3 m/s² in a second."""
Solvers = dict[str, Callable[[], Solver]]


def cm7_solvers(given: Mapping[str, Any]) -> Solvers:
    """EKF and particle filter with the same Q, R and path loss: normal arrivals, none late."""
    path_loss, sd_m = PathLoss(*given["path_loss"]), given["arrival_sd_m"]
    ekf = EkfParameters(path_loss, NOMINAL_JERK_M2_S5, sd_m, level_sd_db=path_loss.shadowing_db)
    on_time = LateArrival(late_probability=0.0)
    pf = ParticleFilterParameters(path_loss, NOMINAL_JERK_M2_S5, sd_m, law=on_time, level_sd_db=path_loss.shadowing_db)
    return {"ekf": lambda: Ekf(ekf), "pf": lambda: ParticleFilter(pf)}


def cm8_solvers(given: Mapping[str, Any]) -> Solvers:
    """Every method of paper D: `ekf` with the channel's true variances, the others with what was chosen for them."""
    path_loss = PathLoss(*given["path_loss"])
    ekf = true_variance_ekf(given)
    alone = TdoaRssParameters(excess_sd_m=given["arrival_sd_m"])
    solvers: Solvers = {"tdoa": lambda: TdoaRss(alone)}
    for name in ("tdoa_rss", "ekf_tuned", "ekf_by_level", "pf_fixed_law", "pf", "robust_tracker"):
        solvers[name] = lambda name=name: build(name, path_loss, given[name])  # type: ignore[misc]
    return {**solvers, "ekf": lambda: Ekf(ekf)}


def true_variance_ekf(given: Mapping[str, Any]) -> EkfParameters:
    """R = the channel's variances of arrival and level, Q as in CM7."""
    path_loss = PathLoss(*given["path_loss"])
    return EkfParameters(path_loss, NOMINAL_JERK_M2_S5, given["arrival_sd_m"], level_sd_db=path_loss.shadowing_db)


def follow(solver: Solver, walk: Walk) -> tuple[Reals, Reals]:
    """Positions (n, 3), NaN without one, and the time of each update [s]."""
    position_m, took_s = [], []
    for blink in walk.blinks:
        began = perf_counter()
        position_m.append(solver.solve(blink).fix.position_m)
        took_s.append(perf_counter() - began)
    return np.array(position_m), np.array(took_s)


def score(name: str, runs: list[tuple[Reals, Reals]], walks: list[Walk]) -> dict[str, float]:
    """Figures of one method over all walks."""
    means = [held_error_m(run[0], walk).mean() for run, walk in zip(runs, walks, strict=True)]
    return {
        f"{name}_m": float(np.mean(means)),
        f"{name}_sd_m": float(np.std(means, ddof=1)),
        f"{name}_available": float(np.mean([np.isfinite(run[0][:, 0]).mean() for run in runs])),
        f"{name}_us": float(1e6 * np.median(np.concatenate([run[1] for run in runs]))),
    }


def score_in_common(runs: Mapping[str, list[tuple[Reals, Reals]]], walks: list[Walk]) -> dict[str, float]:
    """The same of two methods over the blinks for which both have a position, and the spread within a walk."""
    errors = {name: [error_m(run[0], walk) for run, walk in zip(runs[name], walks, strict=True)] for name in runs}
    both = [np.isfinite(one) & np.isfinite(other) for one, other in zip(*errors.values(), strict=True)]
    figures = {}
    for name in runs:
        means = [one[common].mean() for one, common in zip(errors[name], both, strict=True) if common.any()]
        figures |= score(name, runs[name], walks)
        figures |= {f"{name}_m": float(np.mean(means)), f"{name}_sd_m": float(np.std(means, ddof=1))}
        within = [one[common].std() for one, common in zip(errors[name], both, strict=True) if common.any()]
        figures[f"{name}_within_sd_m"] = float(np.mean(within))
    return figures


def run(seeds: range = SEEDS) -> dict[str, Any]:
    """All figures of paper D: by scene and channel."""
    given = json.loads(CHOSEN.read_text("utf-8"))
    chosen: dict[str, Solvers] = {"cm7": cm7_solvers(given["cm7"]), "cm8": cm8_solvers(given["cm8"])}
    rounds = [(scene, channel) for scene in SCENES for channel in chosen]
    figures: dict[str, Any] = {scene: {} for scene in SCENES}
    with Progress(console=Console(stderr=True)) as progress:
        bar = progress.add_task("paper D", total=sum(len(chosen[c]) + 1 for _, c in rounds) + len(PEERS) * len(SCENES))
        for scene, channel in rounds:
            walks = [paper_d_runs(scene, channel, seed) for seed in seeds]  # type: ignore[arg-type]
            progress.advance(bar)
            runs = {}
            for name, make in chosen[channel].items():
                runs[name] = [follow(make(), walk) for walk in walks]
                progress.advance(bar)
            pair = ("ekf", "pf") if channel == "cm7" else ("tdoa", "tdoa_rss")
            row: dict[str, Any] = {"seeds": len(walks)}
            row |= score_in_common({name: runs.pop(name) for name in pair}, walks)
            for name, each in runs.items():
                row |= score(name, each, walks)
            if channel == "cm8":
                for name, begin in PEERS.items():
                    row |= score(
                        name, [run_peer(begin, true_variance_ekf(given["cm8"]), walk) for walk in walks], walks
                    )
                    progress.advance(bar)
            figures[scene][channel] = row
    return figures


def show(figures: Mapping[Scene, Any]) -> Table:
    """Figures as a table."""
    table = Table("scene", "channel", "method", "mean m", "sd m", "available", "µs")
    for scene, channels in figures.items():
        for channel, row in channels.items():
            for name in sorted({key[: -len("_us")] for key in row if key.endswith("_us")}):
                numbers = [f"{row[f'{name}_{key}']:.3f}" for key in ("m", "sd_m", "available")]
                table.add_row(scene, channel, name, *numbers, f"{row[f'{name}_us']:.0f}")
    return table


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--seeds", type=int, default=len(SEEDS), help=f"walks a scene and channel (default {len(SEEDS)})"
    )
    figures = run(range(SEEDS.start, SEEDS.start + parser.parse_args().seeds))
    Console().print(show(figures))
    print(json.dumps(figures, indent=2))


if __name__ == "__main__":
    main()
