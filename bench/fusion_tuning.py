"""Chooses the rivals' settings of bench/fusion_paper_a.py, scene by scene, on tuning seeds (some twenty minutes).

    python bench/fusion_tuning.py

Each rival draws as many candidates; the least mean error wins and goes to bench/fusion_scenes/chosen.json.
"""

import json
import math
from typing import Any

import numpy as np
from fusion_paper_a import CHOSEN, SCENE_NAMES, errors_m, rows_of, solved, walk_of
from fusion_walks import scene, seeds
from rich.progress import track

CANDIDATES = 60
_EKF = {
    "acceleration_sd": [0.1, 0.2, 0.3, 0.5, 1.0, 2.0],
    "position_sd_m": [0.1, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0],
    "step_velocity_sd_ms": [0.05, 0.1, 0.2, 0.3],
}
_WEIGHTED = {
    "los_sd_m": [0.05, 0.1, 0.2, 0.5],
    "nlos_sd_m": [0.3, 0.5, 1.0, 3.0, 10.0],
    "step_share": [0.03, 0.05, 0.07, 0.1],
    "rest_sd_m": [0.005, 0.01, 0.03],
    "factor_walk_sd": [0.0003, 0.001, 0.003, 0.01],
}
SPACE: dict[str, dict[str, list[Any]]] = {
    "los_weighted": _WEIGHTED,
    "los_weighted_residual": _WEIGHTED | {"residual_gate": [1.5, 2.0, 3.0, 4.0, 6.0]},
    "robust_kf": _EKF | {"trust": [0.5, 0.7, 0.9, 0.95]},
    "ekf": _EKF,
    "adaptive_ekf": _EKF | {"memory": [0.8, 0.9, 0.95, 0.98, 0.99]},
    "gtsam": {
        "lag_s": [3.0, 5.0, 10.0],
        "kernel": ["huber", "cauchy", "geman_mcclure"],
        "width": [0.3, 0.5, 1.0, 2.0],
        "range_sd_m": [0.05, 0.1, 0.2, 0.4],
        "way_share": [0.03, 0.06, 0.1],
        "turn_sd_rad": [math.radians(0.1), math.radians(0.3), math.radians(1.0)],
    },
}


def best(scene_name: str, name: str) -> dict[str, Any]:
    """The candidate of a rival with the least mean error in a scene."""
    rng = np.random.default_rng(len(name))
    walks = [walk_of(scene_name, seed) for seed in seeds(scene(scene_name), "tuning_seeds")]
    positions = [solved(walk) for walk in walks]
    drawn = [{key: values[rng.integers(len(values))] for key, values in SPACE[name].items()} for _ in range(CANDIDATES)]

    def error_m(settings: dict[str, Any]) -> float:
        pairs = zip(walks, positions, strict=True)
        return float(np.mean([errors_m(walk, rows_of(name, walk, given, settings)).mean() for walk, given in pairs]))

    errors = [error_m(each) for each in track(drawn, f"{scene_name}: {name}")]
    print(f"{scene_name} {name}: {min(errors):.3f} m with {drawn[int(np.argmin(errors))]}")
    return drawn[int(np.argmin(errors))]


if __name__ == "__main__":
    found = {scene_name: {name: best(scene_name, name) for name in SPACE} for scene_name in SCENE_NAMES}
    CHOSEN.write_text(json.dumps(found, indent=2) + "\n", "utf-8")
