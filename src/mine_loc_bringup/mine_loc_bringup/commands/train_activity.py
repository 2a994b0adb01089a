"""Train the recognition of activities and write a model for the node pdr.

RECORDINGS is a folder of marked walks of a lower back: stand, walk, U-turn, walk back, stop. Each is NAME.json
(Subject, TrialBoundaries, UTurnBoundaries as sample indices at 100 Hz) and NAME_lb.txt.gz (packet counter, force and
rate of a sensor whose X is up and Z backwards), as ipol_gait_lowerback. Simulated walks with turns of 45 to 135 degrees
train beside them. Kernel, constants and features are those that do best on people left out.

Examples:
  mine-loc train-activity "$MINE_LOC_DATA/ipol_gait_lowerback/GaitData" --out build/activity.npz
"""

import argparse
import dataclasses
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("recordings", type=Path, metavar="RECORDINGS", help="folder of marked walks, see above")
    add("--out", type=Path, required=True, metavar="FILE", help="model to write (npz)")
    add("--seed", type=int, default=0, metavar="K", help="of the simulated people (default 0)")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 when the model is written."""
    from mine_loc_bringup.activity import training_set as data  # noqa: PLC0415 scikit-learn is slow to load
    from mine_loc_pdr.activity_labels import BORDER_RAD  # noqa: PLC0415
    from mine_loc_pdr.activity_model_file import save_model  # noqa: PLC0415
    from mine_loc_pdr.activity_training import CANDIDATES, FOLDS, train  # noqa: PLC0415

    out: Path = arguments.out
    with Progress(console=Console(stderr=True)) as progress:
        walking = progress.add_task("walking", total=data.SIMULATED_PEOPLE)
        simulated = data.simulated(arguments.seed, lambda: progress.advance(walking))
        windows = data.taught(data.of_recordings(arguments.recordings) + simulated)
        choosing = progress.add_task("choosing", total=len(CANDIDATES))
        model, chosen = train(windows, lambda: progress.advance(choosing))
    counts = Counter(each.label.name.lower() for each in windows)
    card: dict[str, Any] = {
        "version": f"{datetime.now(UTC):%Y-%m-%d}",
        "data": f"{arguments.recordings.parent.name}/{arguments.recordings.name}, simulated walks",
        "recorded_people": len({each.person for each in windows}) - data.SIMULATED_PEOPLE,
        "simulated_people": data.SIMULATED_PEOPLE,
        "seed": arguments.seed,
        "windows": dict(counts),
        "least_turn_in_a_window_rad": round(BORDER_RAD, 4),
        "candidate": dataclasses.asdict(chosen.candidate),
        "protocol": f"figures: {FOLDS} folds over people, which also chose among {len(CANDIDATES)} candidates",
        "figures": data.figures(chosen),
    }
    save_model(out, model, card)
    print(f"{out}: {out.stat().st_size / 1e3:.0f} kB, {len(model.svm.support)} support vectors, {chosen.candidate}")
    for name, value in card["figures"].items():
        print(f"  {name:20} {value}")
    return 0
