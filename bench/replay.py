"""Simulated mines from bytes to poses, replayed without a graph: writes bench/results/replay.json.

    python bench/replay.py [--seeds N]

Errors, honesty and speed. People walk in the shipped sites `example_mine` and `gallery_2km`: uncalibrated radios,
anchors nearly in line, links obstructed by rock and machines; what the drivers make of their bytes goes through the
nodes with default parameters. `mine_loc_without_walls` is the same with a site file that says nothing of galleries and
chambers; rivals are other `method`s of the fusion. `times_real_time` is one person, with and without accumulators, the
start left out.
"""

import argparse
import json
import shutil
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from rich.progress import track

from mine_loc_bringup.evaluation.bag_evaluation import evaluate_bag
from mine_loc_bringup.main import main as mine_loc
from mine_loc_bringup.offline_run import replay_offline

RESULTS = Path(__file__).parent / "results" / "replay.json"
SITES = Path(__file__).parents[1] / "config"
PLACES = ("example_mine", "gallery_2km")
METHODS = ("mine_loc", "mine_loc_without_walls", "adaptive_ekf", "los_weighted_residual")
FIRST_SEED = 51
PEOPLE, SECONDS, SPEED_SECONDS = 3, 60, 120
MEASURES = ("horizontal_mean_m", "ce95_m", "nees_mean", "claimed_ce95_holds", "claimed_ce95_m")


def simulated(folder: Path, site: str, seed: int, *more: str) -> Path:
    """A bag of people in a site of config/."""
    bag = folder / f"{site}_{seed}"
    words = ["simulate", "--site", str(SITES / site), "--seed", str(seed), "--bag", str(bag), *more]
    assert mine_loc(words) == 0
    return bag


def without_walls(bag: Path) -> Path:
    """The site of a bag, with nothing said of galleries and chambers."""
    site = bag.parent / f"{bag.name}_site"
    shutil.copytree(bag / "site", site)
    content = yaml.safe_load((site / "site.yaml").read_text("utf-8"))
    for key in ("galleries", "chambers", "turn_markers"):
        content.pop(key, None)
    (site / "site.yaml").write_text(yaml.safe_dump(content, sort_keys=False), "utf-8")
    return site


def errors(place: str, seeds: range, folder: Path) -> dict[str, Any]:
    """Measures of each method: means over runs, and the 95 % interval of the mean error."""
    rows: dict[str, list[list[float]]] = {method: [] for method in METHODS}
    for seed in track(seeds, place):
        bag = simulated(folder, place, seed, "--people", str(PEOPLE), "--seconds", str(SECONDS))
        for method in METHODS:
            site = without_walls(bag) if method == "mine_loc_without_walls" else None
            changes = [] if method.startswith("mine_loc") else [f"fusion.method={method}"]
            out = folder / f"{bag.name}_{method}"
            replay_offline(bag, out, site=site, changes=changes)
            measures = evaluate_bag(out).together
            rows[method].append([float(getattr(measures, name) or np.nan) for name in MEASURES])
    return {method: _summary(np.array(found)) for method, found in rows.items()}


def _summary(rows: np.ndarray) -> dict[str, float]:
    figures = dict(zip(MEASURES, rows.mean(axis=0).tolist(), strict=True))
    figures["horizontal_mean_m_ci95"] = float(1.96 * rows[:, 0].std(ddof=1) / np.sqrt(len(rows)))
    return figures


def speed(folder: Path) -> dict[str, float]:
    """Times real time with one person."""
    found = {}
    for name, more in (("ranges", []), ("accumulators", ["--cir"])):
        words = ("--people", "1", "--seconds", str(SPEED_SECONDS), *more)
        bag = simulated(folder / name, "example_mine", FIRST_SEED, *words)
        found[name] = replay_offline(bag, folder / name / "out").speed
    return found


def main() -> None:
    """Run, print and write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=6, help="runs a site (default 6)")
    seeds = range(FIRST_SEED, FIRST_SEED + parser.parse_args().seeds)
    with tempfile.TemporaryDirectory() as name:
        results: dict[str, Any] = {place: errors(place, seeds, Path(name)) for place in PLACES}
        results["times_real_time"] = speed(Path(name))
    results["settings"] = {"people": PEOPLE, "seconds": SECONDS, "seeds": list(seeds)}
    RESULTS.parent.mkdir(exist_ok=True)
    RESULTS.write_text(json.dumps(results, indent=2) + "\n", "utf-8")
    json.dump(results, sys.stdout, indent=2)


if __name__ == "__main__":
    main()
