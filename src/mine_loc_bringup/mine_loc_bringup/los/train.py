"""A training run: inner folds, then the network on everything; resumable between networks."""

import dataclasses
import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from mine_loc_sim.labelled_links import draw_links
from mine_loc_uwb.labelled_frames import LabelledFrames, training_set
from mine_loc_uwb.los_network import LosNetwork
from mine_loc_uwb.los_training import (
    HeldOut,
    Selection,
    TrainingOptions,
    held_out,
    inner_folds,
    select,
    train,
)
from mine_loc_uwb.training_set import TrainingSet

SIMULATED_LINKS = 6000
Progress = Callable[[int], None]


def simulated_links(seed: int, count: int = SIMULATED_LINKS) -> TrainingSet:
    """Draw CM7, CM8 and CM4 links with their four classes, balanced by class, to train beside real frames."""
    drawn = draw_links(count, seed)
    number = np.arange(len(drawn.link_class))
    allowed = drawn.link_class[:, None] == np.arange(1, 5)
    frames = LabelledFrames(drawn.frames, allowed, drawn.link_class, number.tolist(), number)
    return training_set([frames])[0]


def networks_to_train(options: TrainingOptions) -> int:
    """How many networks a run trains."""
    return options.inner_folds + 1


def fit(
    data: TrainingSet,
    options: TrainingOptions,
    seed: int,
    auxiliary: TrainingSet | None,
    *,
    resume: Path | None = None,
    progress: Progress | None = None,
) -> tuple[LosNetwork, Selection]:
    """Choose steps and temperature on inner folds, then train on all placements.

    resume: folder in which each finished fold is kept; what is there already is not trained again.
    """
    judged = []
    for number, places in enumerate(inner_folds(data, options.inner_folds, seed)):
        kept = None if resume is None else resume / f"fold_{number}.npz"
        if kept is not None and kept.is_file():
            judged.append(_read(kept))
            if progress is not None:
                progress(options.steps)
            continue
        judged.append(held_out(data, places, options, seed, auxiliary, progress))
        if kept is not None:
            _write(kept, judged[-1])
    chosen = select(judged, options)
    *_, network = train(data, dataclasses.replace(options, steps=chosen.steps), seed, auxiliary, progress)
    network.temperature.copy_(torch.tensor(chosen.temperature))
    return network, chosen


def resume_folder(out: Path, description: dict[str, Any]) -> Path:
    """Folder beside `out` for what is finished; emptied if it belongs to another run than the one described."""
    folder = out.with_name(out.name + ".partial")
    note = folder / "run.json"
    text = json.dumps(description, sort_keys=True)
    if note.is_file() and note.read_text("utf-8") != text:
        clear(folder)
    folder.mkdir(parents=True, exist_ok=True)
    note.write_text(text, "utf-8")
    return folder


def clear(folder: Path) -> None:
    """Remove what `fit` and `resume_folder` wrote."""
    for path in (*folder.glob("fold_*.npz"), folder / "run.json"):
        path.unlink(missing_ok=True)
    folder.rmdir()


def data_hash(path: Path) -> str:
    """SHA-256 over the files of a recording."""
    total = hashlib.sha256()
    known = [path / name for name in ("cir_iq.npz", "frames.csv") if (path / name).is_file()]
    for file in known or ([path] if path.is_file() else sorted(path.glob("*.mcap"))):
        total.update(file.read_bytes())
    return total.hexdigest()


def _write(path: Path, judged: HeldOut) -> None:
    partial = path.with_suffix(".tmp.npz")
    np.savez(partial, **{field.name: getattr(judged, field.name) for field in dataclasses.fields(judged)})
    partial.replace(path)


def _read(path: Path) -> HeldOut:
    with np.load(path, allow_pickle=False) as file:
        return HeldOut(*(file[field.name] for field in dataclasses.fields(HeldOut)))
