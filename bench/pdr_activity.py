"""Standing, straight or turning, judged on people the machine was not trained on; docs/pdr.md explains the rows."""

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from pdr_recordings import folder
from pdr_tracks import spread

from mine_loc_bringup.activity import training_set
from mine_loc_bringup.activity.recordings import marks, recording_names
from mine_loc_bringup.activity.simulated_walks import simulated_windows
from mine_loc_pdr.activity import ActivityKind, ActivityModel
from mine_loc_pdr.activity_labels import HALF_STEP_NS, LabelledWindow
from mine_loc_pdr.activity_model_file import load_model, shipped_model
from mine_loc_pdr.activity_training import balanced_accuracy, train
from mine_loc_pdr.activity_window import BINS, WINDOW_NS, ActivityWindow

SCORED_PEOPLE = 60  # simulated, of seeds that are not trained with
SCORED_S = 300.0
Judge = Callable[[ActivityWindow], ActivityKind]
Judged = tuple[LabelledWindow, ActivityKind]
MOVING = {"straight": ActivityKind.STRAIGHT, "turn": ActivityKind.TURNING}


def activity() -> dict[str, Any]:
    """Recorded people and simulated ones."""
    recordings = folder("ipol_gait_lowerback") / "GaitData"
    recorded = training_set.of_recordings(recordings)
    simulated = training_set.simulated(0)
    return {"ipol": ipol(recordings, recorded, simulated), "sim": sim(recorded + simulated)}


def ipol(path: Path, recorded: Sequence[LabelledWindow], simulated: Sequence[LabelledWindow]) -> dict[str, Any]:
    """Each person judged by what the others, and the simulated, taught."""
    by_model: list[Judged] = []
    by_recordings: list[Judged] = []
    by_threshold: list[Judged] = []
    candidates: Counter[str] = Counter()
    for person in sorted({each.person for each in recorded}):
        own = [each for each in recorded if each.person == person]
        others = training_set.taught([each for each in recorded if each.person != person])
        everybody = others + training_set.taught(simulated)
        model, chosen = train(everybody)
        candidates[f"{chosen.candidate.features} {chosen.candidate.kernel} C={chosen.candidate.cost:g}"] += 1
        by_model += judged(own, judge_of(model))
        by_recordings += judged(own, judge_of(train(others)[0]))
        by_threshold += judged(own, threshold_judge(model, everybody))
    walked = within_walks(path, by_model)
    return accuracies(first_tiling(by_model)) | {
        "standing": standing(by_model),
        "tilings": tilings(by_model),
        "undecidable": undecidable(path, first_tiling(walked)),
        "to_the_marked_end": accuracies(first_tiling(to_the_marked_end(path, walked))),
        "chosen": dict(candidates),
        "recordings_only": accuracies(first_tiling(by_recordings)) | {"tilings": tilings(by_recordings)},
        "plain_threshold": accuracies(first_tiling(by_threshold)) | {"tilings": tilings(by_threshold)},
    }


def sim(training: Sequence[LabelledWindow]) -> dict[str, Any]:
    """The shipped model on simulated people of other seeds."""
    windows = [each for seed in range(SCORED_PEOPLE) for each in simulated_windows(seed, SCORED_S)]
    model, _ = load_model(shipped_model())
    by_model = judged(windows, judge_of(model))
    by_threshold = judged(windows, threshold_judge(model, training_set.taught(training)))
    scored = [pair for pair in by_model if pair[0].decidable]
    counts = Counter(each.label.name.lower() for each, _ in first_tiling(by_model))
    return accuracies(first_tiling(scored)) | {
        "people": SCORED_PEOPLE,
        "standing": share([kind == each.label for each, kind in first_tiling(scored) if is_standing(each)]),
        "tilings": tilings(scored),
        "starts_and_halts": counts["unknown"],
        "undecidable": sum(not each.decidable and each.label in MOVING.values() for each, _ in first_tiling(by_model)),
        "with_undecidable": accuracies(first_tiling(by_model)),
        "plain_threshold": accuracies(first_tiling([pair for pair in by_threshold if pair[0].decidable]))
        | {"with_undecidable": accuracies(first_tiling(by_threshold))},
    }


def judge_of(model: ActivityModel) -> Judge:
    return lambda window: model.judge(window).kind


def threshold_judge(model: ActivityModel, training: Sequence[LabelledWindow]) -> Judge:
    """The rival: a turn is a change of heading, from end to end, past the threshold that was best in training."""
    moving = [each for each in training if each.label in MOVING.values()]
    change = np.array([abs(each.window.turn_rad) for each in moving])
    turning = np.array([each.label == ActivityKind.TURNING for each in moving])
    thresholds = np.radians(np.arange(5.0, 90.0, 0.5))
    best = max(thresholds, key=lambda threshold: balanced_accuracy(change >= threshold, turning))

    def judge(window: ActivityWindow) -> ActivityKind:
        if model.judge(window).kind == ActivityKind.STANDING:
            return ActivityKind.STANDING
        return ActivityKind.TURNING if abs(window.turn_rad) >= best else ActivityKind.STRAIGHT

    return judge


def judged(windows: Iterable[LabelledWindow], judge: Judge) -> list[Judged]:
    return [(each, judge(each.window)) for each in windows]


def tiling(pairs: Iterable[Judged], begin: int) -> list[Judged]:
    """Windows that follow one another without overlap, the first `begin` bins after the beginning of the walk."""
    return [(each, kind) for each, kind in pairs if each.place % BINS == begin]


def first_tiling(pairs: Iterable[Judged]) -> list[Judged]:
    return tiling(pairs, 0)


def share(right: Sequence[bool]) -> dict[str, Any]:
    """Share that is right, of how many, with Wilson's 95 % interval."""
    n, hits, z = len(right), sum(right), 1.959964
    p = hits / n
    middle, half = p + z * z / (2 * n), z * np.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    low, high = ((middle + sign * half) / (1 + z * z / n) for sign in (-1, 1))
    return {"share": round(p, 4), "right": hits, "of": n, "ci95": [round(float(low), 4), round(float(min(high, 1)), 4)]}


def accuracies(pairs: Sequence[Judged]) -> dict[str, Any]:
    """Of straight and turning windows, with spread over people; a window taken for standing is wrong."""
    rows: dict[str, Any] = {}
    for name, kind in MOVING.items():
        right = [(each.person, said == kind) for each, said in pairs if each.label == kind]
        counted = share([hit for _, hit in right])
        people = sorted({person for person, _ in right})
        means = [float(np.mean([hit for who, hit in right if who == person])) for person in people]
        rows[f"{name}_accuracy"] = counted.pop("share")
        rows[name] = counted | {"people_sd": round(float(np.std(means)), 4), "people_min": round(min(means), 4)}
    return rows


def tilings(pairs: Sequence[Judged]) -> dict[str, dict[str, float]]:
    """Accuracy over all tilings, each begun 0.2 s after the one before: how much hangs on where windows lie."""
    table = [accuracies(tiling(pairs, begin)) for begin in range(BINS)]
    rows = {}
    for name in MOVING:
        values = [row[f"{name}_accuracy"] for row in table]
        rows[name] = {key: each for key, each in spread(values, 4).items() if key != "max"} | {"min": min(values)}
    return rows


def is_standing(each: LabelledWindow) -> bool:
    return each.label == ActivityKind.STANDING


def standing(pairs: Sequence[Judged]) -> dict[str, Any]:
    """Of the last window of each walk that ends before the walk begins, where the recording holds one."""
    last = {each.walk: kind for each, kind in pairs if is_standing(each)}
    return share([kind == ActivityKind.STANDING for kind in last.values()])


def within_walks(path: Path, pairs: Sequence[Judged]) -> list[Judged]:
    """Windows between the marked begin and end."""
    walks = {name: marks(path, name)[1] for name in recording_names(path)}
    return [pair for pair in pairs if pair[0].place >= 0 and pair[0].window.end_ns <= walks[pair[0].walk].end_ns]


def _after_turn(path: Path, pairs: Sequence[Judged]) -> list[Judged]:
    """Windows without a label that begin after the U-turn."""
    walks = {name: marks(path, name)[1] for name in recording_names(path)}
    unknown = [pair for pair in pairs if pair[0].label == ActivityKind.UNKNOWN]
    return [
        pair for pair in unknown if pair[0].window.end_ns - WINDOW_NS >= walks[pair[0].walk].turn_end_ns + HALF_STEP_NS
    ]


def undecidable(path: Path, pairs: Sequence[Judged]) -> dict[str, int]:
    """Windows of the walks that are not scored, by reason."""
    unknown = sum(each.label == ActivityKind.UNKNOWN for each, _ in pairs)
    late = len(_after_turn(path, pairs))
    return {"part_of_uturn": unknown - late, "way_back_may_be_over": late}


def to_the_marked_end(path: Path, pairs: Sequence[Judged]) -> list[Judged]:
    """The harsher reading: whatever lies between the U-turn and the marked end is straight."""
    late = [(replace(each, label=ActivityKind.STRAIGHT), kind) for each, kind in _after_turn(path, pairs)]
    return [pair for pair in pairs if pair[0].label != ActivityKind.UNKNOWN] + late
