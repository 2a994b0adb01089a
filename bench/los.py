"""The LOS/NLOS classifier against placements and scenes it has never seen: writes bench/results/los.json.

`real`: leave-one-placement-out over the 27 placements of uwb_cirs_2018. Steps and temperature of each network come
from inner folds over its training placements. `rf` is a random forest on the hand features of `cir_features` in the
same folds, `rf_same_inputs` one on all side features the network has, link history included. `real_no_range` are the
same networks with the range hidden, `rf_no_range` forests without it. `sim_four_class`: trained on walks in simulated
mines, scored on walks of other people in another. Figures are means over seeds, with `_sd` beside each.
"""

import argparse
import json
import os
import time
from collections.abc import Iterator
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import torch
from cir_features import features
from los_scenes import TEST_SCENES, TRAINING_SCENES, walk_frames
from numpy.typing import NDArray
from rich.progress import track
from sklearn.ensemble import RandomForestClassifier

from mine_loc_bringup.los.recordings import read_recording
from mine_loc_bringup.los.report import figures_of, inner_figures
from mine_loc_bringup.los.train import fit, simulated_links
from mine_loc_uwb.cir_input import RANGE_FEATURES, SIDE_NAMES
from mine_loc_uwb.labelled_frames import LabelledFrames, training_set
from mine_loc_uwb.link_judgement import LinkJudge, load_classifier
from mine_loc_uwb.los_measures import binary_measures, over_seeds
from mine_loc_uwb.los_model_file import read_card, shipped_model
from mine_loc_uwb.los_training import TrainingOptions, log_probabilities, los_probability, train
from mine_loc_uwb.training_set import TrainingSet, balanced_weights

HERE = Path(__file__).parent
SEEDS = (1, 2, 3)
FOREST_EVERY = 4  # neighbouring frames of one placement are near copies
SIMULATED = TrainingOptions(
    steps=3000,
    check_every=3000,
    batch=256,
    learning_rate=2e-3,
    averaging=0.995,
    caution=0.0,
    augment=False,
    hide_range=0.0,
    hide_levels=0.0,
)
Reals = NDArray[np.float64]
Fold = tuple[int, int]


class Recording:
    """uwb_cirs_2018, read once a process."""

    frames: LabelledFrames
    data: TrainingSet
    simulated: dict[int, TrainingSet]

    @classmethod
    def load(cls) -> None:
        torch.set_num_threads(1)
        cls.frames = read_recording(Path(os.environ["MINE_LOC_DATA"]) / "uwb_cirs_2018")
        cls.data, refused = training_set([cls.frames])
        assert not refused, refused
        cls.simulated = {}


def network_fold(fold: Fold) -> tuple[int, Reals, Reals, int]:
    """Judge one placement by a network trained on the others, with and without its range."""
    seed, place = fold
    if seed not in Recording.simulated:
        Recording.simulated = {seed: simulated_links(seed)}
    out = Recording.data.placement == place
    network, chosen = fit(Recording.data.take(~out), TrainingOptions(), seed, Recording.simulated[seed])
    given = Recording.data.take(out).input
    return place, los_probability(network, given), los_probability(network, given.without_range()), chosen.steps


def forest_fold(task: tuple[int, int, str]) -> tuple[int, Reals]:
    """Judge one placement by a forest trained on every fourth frame of the others."""
    seed, place, inputs = task
    values, data = forest_inputs(inputs), Recording.data
    out = data.placement == place
    rest = np.flatnonzero(~out)[::FOREST_EVERY]
    forest = RandomForestClassifier(100, min_samples_leaf=20, random_state=seed)
    forest.fit(values[rest], data.los[rest], sample_weight=balanced_weights(data.los[rest], data.placement[rest]))
    return place, forest.predict_proba(values[out])[:, 1]


def forest_inputs(name: str) -> Reals:
    """Inputs (n, f) of the forests."""
    side = Recording.data.input.side
    if name.startswith("same_inputs"):
        hidden = [number + offset for number in RANGE_FEATURES for offset in (0, len(SIDE_NAMES))]
        return np.delete(side, hidden, axis=1) if name.endswith("no_range") else side
    frames = Recording.frames.frames
    magnitude = np.hypot(*np.moveaxis(frames.samples.astype(np.float32), 2, 0))
    powers = frames.receive_power_dbm, frames.first_path_power_dbm
    hand = features(magnitude, frames.first_path_index, frames.symbols, *powers)
    hand = np.column_stack([hand, frames.first_path_power_dbm])
    return hand if name.endswith("no_range") else np.column_stack([hand, frames.range_m])


def real(pool: Any) -> dict[str, Any]:
    """All figures on real receptions."""
    data = Recording.data
    places = np.unique(data.placement).tolist()
    runs: dict[str, list[dict[str, Any]]] = {"real": [], "real_no_range": []}
    steps = []
    for seed in SEEDS:
        judged = {name: np.zeros(len(data.input)) for name in runs}
        tasks = [(seed, place) for place in places]
        done = pool.imap_unordered(network_fold, tasks)
        for place, *both, used in track(done, f"network, seed {seed}", total=len(tasks)):
            steps.append(used)
            for values, probability in zip(judged.values(), both, strict=True):
                values[data.placement == place] = probability
        for name, probability in judged.items():
            runs[name].append(binary_measures(probability, data.los, data.placement))
    found = {name: over_seeds(each) for name, each in runs.items()}
    found["real"]["steps_chosen"] = {str(count): steps.count(count) for count in sorted(set(steps))}
    return found | dict(forests(pool, places))


def forests(pool: Any, places: list[int]) -> Iterator[tuple[str, dict[str, Any]]]:
    """The rivals."""
    data = Recording.data
    for inputs in ("hand", "hand_no_range", "same_inputs", "same_inputs_no_range"):
        runs = []
        for seed in SEEDS:
            probability = np.zeros(len(data.input))
            tasks = [(seed, place, inputs) for place in places]
            for place, values in track(pool.imap_unordered(forest_fold, tasks), f"forest, {inputs}", total=len(tasks)):
                probability[data.placement == place] = values
            runs.append(binary_measures(probability, data.los, data.placement))
        yield "rf" + ("_" + inputs).replace("_hand", ""), over_seeds(runs)


def simulated_fold(seed: int) -> dict[str, Any]:
    """Train on walks in one mine, judge walks in another; equal numbers of each class, as paper A's records."""
    training, _ = training_set([walk_frames(scene, seed) for scene in TRAINING_SCENES])
    test, _ = training_set([walk_frames(scene, 100 + seed) for scene in TEST_SCENES])
    kind = test.allowed.argmax(axis=1)
    rng = np.random.default_rng(seed)
    fewest = np.bincount(kind, minlength=4).min()
    test = test.take(np.concatenate([rng.permutation(np.flatnonzero(kind == each))[:fewest] for each in range(4)]))
    by_class = TrainingSet(training.input, training.allowed, training.allowed.argmax(axis=1))
    *_, network = train(by_class, SIMULATED, seed)
    figures = figures_of(log_probabilities(network, test.input), test.allowed, test.placement)
    confusion = np.array(figures["four_class"]["confusion"])
    off = confusion.sum() - np.trace(confusion)
    return figures["four_class"] | {
        "one_against_rest_accuracy": float(1.0 - 0.5 * off / confusion.sum()),
        "los_accuracy": figures["accuracy"],
        "los_auc": figures["auc"],
        "frames": len(test.input),
    }


def speed() -> dict[str, float]:
    """The shipped model on one core, input stage and history included: single frames and a batch.

    Time is the thread's own on the processor, so that other work on the machine does not count; `wall_` is the clock's.
    """
    frames, path = Recording.frames.frames.take(slice(0, 2048)), shipped_model()
    judge = LinkJudge(load_classifier(path, "cpu")[0])
    spent_ms = []
    for number in range(len(frames)):
        one, began = frames.take(slice(number, number + 1)), _clocks()
        judge.judge(one, [0], [number * 100_000_000])
        spent_ms.append(1e3 * (_clocks() - began))
    links = [number % 64 for number in range(len(frames))]
    stamps_ns = [number // 64 * 100_000_000 for number in range(len(frames))]
    spent_s = []
    for _ in range(10):
        judge.forget()
        began = _clocks()
        judge.judge(frames, links, stamps_ns)
        spent_s.append(_clocks() - began)
    own_ms, wall_ms = np.array(spent_ms[100:]).T
    return {
        "model_kb": path.stat().st_size / 1e3,
        "ms_per_frame_p50": float(np.median(own_ms)),
        "ms_per_frame_p99": float(np.quantile(own_ms, 0.99)),
        "wall_ms_per_frame_p50": float(np.median(wall_ms)),
        "frames_per_s_batch": float(len(frames) / np.median(np.array(spent_s)[:, 0])),
    }


def _clocks() -> Reals:
    return np.array([time.thread_time(), time.perf_counter()])


def card_fold(seed: int) -> dict[str, float]:
    """Figures that a card would state if the shipped model were trained anew with this seed."""
    _, chosen = fit(Recording.data, TrainingOptions(), seed, simulated_links(seed))
    return inner_figures(chosen)


def shipped(pool: Any) -> dict[str, Any]:
    """What the card of the shipped model states, and the same figures of trainings anew."""
    stated = read_card(shipped_model())["figures"]
    return {"stated": stated, "trained_anew": over_seeds(list(pool.imap(card_fold, SEEDS)))}


PARTS = ("real", "sim", "card", "speed")


def main() -> None:
    """Write the figures of the parts asked for beside those that are there."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, default=HERE / "results" / "los.json", help="file to write into")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help="default: all")
    arguments = parser.parse_args()
    Recording.load()
    known = json.loads(arguments.json.read_text()) if arguments.json.exists() else {}
    if "speed" in arguments.parts:
        known.update(speed())
    with get_context("spawn").Pool(2, Recording.load) as pool:
        if "sim" in arguments.parts:
            known["sim_four_class"] = over_seeds(list(track(pool.imap(simulated_fold, SEEDS), "simulated", len(SEEDS))))
        if "card" in arguments.parts:
            known["card"] = shipped(pool)
        if "real" in arguments.parts:
            known.update(real(pool))
    arguments.json.parent.mkdir(parents=True, exist_ok=True)
    arguments.json.write_text(json.dumps(known, indent=2, sort_keys=True) + "\n")
    print(
        json.dumps(
            {
                k: {a: b for a, b in v.items() if a != "placements"} if isinstance(v, dict) else v
                for k, v in known.items()
            },
            indent=2,
        )
    )


if __name__ == "__main__":
    main()
