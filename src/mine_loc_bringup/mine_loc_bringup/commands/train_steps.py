"""Train the recognition of steps and write a model for the node pdr.

RECORDINGS is a folder of marked walks of a lower back. Each is NAME.json (Subject, TrialBoundaries, LeftFootEvents and
RightFootEvents as pairs of sample indices at 100 Hz, the second the heel strike) and NAME_lb.txt.gz (packet counter,
force and rate of a sensor whose X is up and Z backwards), as ipol_gait_lowerback. Rides, blows and sitting down are
drawn beside them, so that the network learns what is no step. `make bench-pdr` says how well it does on people left
out.

Examples:
  mine-loc train-steps "$MINE_LOC_DATA/ipol_gait_lowerback/GaitData" --out build/steps.npz
"""

import argparse
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress

THRESHOLD = 0.25
"""The probability from which a maximum in rhythm is a step: of those that the bench tries, what most left out chose."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("recordings", type=Path, metavar="RECORDINGS", help="folder of marked walks, see above")
    add("--out", type=Path, required=True, metavar="FILE", help="model to write (npz)")
    add("--seed", type=int, default=0, metavar="K", help="of the first weights and of all that is drawn (default 0)")
    add("--rounds", type=int, metavar="N", help="how long to train (default as the shipped model)")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 when the model is written."""
    from mine_loc_bringup.step_recordings import marked_walks  # noqa: PLC0415
    from mine_loc_pdr.step_detector import StepModel  # noqa: PLC0415
    from mine_loc_pdr.step_model_file import save_step_model  # noqa: PLC0415
    from mine_loc_pdr.step_training import ROUNDS, train  # noqa: PLC0415 torch is slow to load

    rounds = arguments.rounds or ROUNDS
    walks = list(marked_walks(arguments.recordings))
    with Progress(console=Console(stderr=True)) as progress:
        training = progress.add_task("training", total=rounds)
        weights = train([motion for _, motion in walks], arguments.seed, rounds, lambda: progress.advance(training))
    card: dict[str, Any] = {
        "version": f"{datetime.now(UTC):%Y-%m-%d}",
        "data": f"{arguments.recordings.parent.name}/{arguments.recordings.name}, drawn motions without steps",
        "recorded_people": len({person for person, _ in walks}),
        "walks": len(walks),
        "steps": sum(int((motion.strikes_s < motion.end_s).sum()) for _, motion in walks),
        "seed": arguments.seed,
        "rounds": rounds,
    }
    out: Path = arguments.out
    save_step_model(out, StepModel(weights, THRESHOLD), card)
    print(f"{out}: {out.stat().st_size / 1e3:.0f} kB, {card['steps']} steps of {card['recorded_people']} people")
    return 0
