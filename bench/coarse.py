"""Coarse regions in paper E's setting, beside its rivals; writes bench/results/coarse.json.

    python bench/coarse.py [--json FILE] [--seeds 60]

docs/coarse.md defines every measure. The rivals' settings were chosen on other seeds (`--tune` prints the search).
"""

import argparse
import itertools
import json
import os
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")  # one core: before numpy is loaded
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parent))

import numpy as np
from coarse_measures import score, summary
from coarse_methods import Answer, DbscanTuning, coarse, crossing_alone, dbscan, initial_set
from coarse_scenes import NODES, Scene, draw_scene
from rich.console import Console
from rich.table import Table

RESULTS = Path(__file__).parent / "results" / "coarse.json"
FIRST_TUNING_SEED = 900_000
DBSCAN = DbscanTuning(eps_m=800.0, min_samples=5, weighted=True, radius_scale=0.7)
"""Chosen by `--tune` from the grid below on 20 scenes of 25 nodes."""
GRID = {"eps_m": (200.0, 400.0, 600.0, 800.0, 1000.0), "min_samples": (3, 5, 8), "weighted": (False, True)}
SCALES = ((100, 20), (300, 50), (1000, 100))
SCALE_SCENES = 3


def main() -> int:
    """Score everything and write the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, default=RESULTS, help="file to write")
    parser.add_argument("--seeds", type=int, default=60, help="scenes a row")
    parser.add_argument("--tune", action="store_true", help="search DBSCAN's settings on other seeds, print, and end")
    arguments = parser.parse_args()
    if arguments.tune:
        return _tune()
    console, began = Console(), time.monotonic()
    figures: dict[str, Any] = {"seeds": arguments.seeds}
    coarse(draw_scene(FIRST_TUNING_SEED, 10))  # what is loaded at the first use is not the situation's time
    for nodes in NODES:
        _rows(figures, nodes, range(arguments.seeds))
        console.print(f"{nodes} nodes: {time.monotonic() - began:.0f} s")
    figures["scale"] = _scale()
    arguments.json.parent.mkdir(parents=True, exist_ok=True)
    arguments.json.write_text(json.dumps(figures, indent=2, sort_keys=True) + "\n", "utf-8")
    console.print(_table(figures))
    console.print(f"written: {arguments.json}")
    return 0


def _rows(figures: dict[str, Any], nodes: int, seeds: Sequence[int]) -> None:
    methods: dict[str, Callable[[Scene], Answer]] = {
        "nodes": coarse,
        "dbscan": lambda scene: dbscan(scene, DBSCAN),
        "crossing": crossing_alone,
    }
    for name, method in methods.items():
        scores = [score(scene, method(scene), initial_set(scene)) for scene in _scenes(nodes, seeds)]
        figures.setdefault(name, {})[str(nodes)] = summary(scores, "nodes")
        if name == "nodes":
            figures.setdefault("all_nodes", {})[str(nodes)] = summary(scores, "all_nodes")
    for name, options in (("first_round", {"rounds": 1}), ("bias_1deg", {"bias_deg": 1.0})):
        scores = [score(scene, coarse(scene), initial_set(scene)) for scene in _scenes(nodes, seeds, **options)]
        figures.setdefault(name, {})[str(nodes)] = summary(scores, "nodes")


def _scenes(nodes: int, seeds: Sequence[int], **options: Any) -> list[Scene]:
    return [draw_scene(seed, nodes, **options) for seed in seeds]


def _scale() -> dict[str, Any]:
    """Time and error of larger fields, and time over n log n of the reports, which growth like it leaves constant."""
    found: dict[str, Any] = {}
    for nodes, monitors in SCALES:
        scenes = [draw_scene(seed, nodes, monitors=monitors) for seed in range(SCALE_SCENES)]
        summed = summary([score(scene, coarse(scene), initial_set(scene)) for scene in scenes], "nodes")
        reports = float(np.mean([len(scene.sent) for scene in scenes]))
        found[str(nodes)] = summed | {
            "monitors": monitors,
            "reports": reports,
            "time_per_n_log_n_ns": summed["time_s"] * 1e9 / (reports * np.log2(reports)),
        }
    return found


def _tune() -> int:
    scenes = _scenes(25, range(FIRST_TUNING_SEED, FIRST_TUNING_SEED + 20))
    initial = [initial_set(scene) for scene in scenes]
    rows = []
    for values in itertools.product(*GRID.values()):
        tuning = DbscanTuning(*values, radius_scale=DBSCAN.radius_scale)
        found = summary([score(s, dbscan(s, tuning), i) for s, i in zip(scenes, initial, strict=True)], "nodes")
        wrong = (1.0 - found["found"]) * found["count"] / len(scenes) + found["ghosts_per_scene"]
        rows.append((wrong, found["error_m"], found["containment"], tuning))
    for wrong, error_m, containment, tuning in sorted(rows, key=lambda row: row[:2])[:10]:
        Console().print(f"{wrong:.2f} missed or false a scene, {error_m:.0f} m, held {containment:.3f}: {tuning}")
    return 0


def _table(figures: dict[str, Any]) -> Table:
    columns = ("found", "ghosts_per_scene", "error_m", "error_ce95_m", "containment", "topology_accuracy", "time_s")
    table = Table("row", *columns, title="coarse regions")
    for name in ("nodes", "all_nodes", "dbscan", "crossing", "first_round", "bias_1deg", "scale"):
        for nodes, row in figures[name].items():
            table.add_row(f"{name}.{nodes}", *(f"{row[column]:.4g}" for column in columns))
    return table


if __name__ == "__main__":
    sys.exit(main())
