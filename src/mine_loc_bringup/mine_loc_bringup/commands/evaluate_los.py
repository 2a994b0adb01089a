"""Score a LOS/NLOS model on labelled receptions it was not trained on.

DATA is what mine-loc train-los takes. Prints and writes accuracy, balanced accuracy (frames pooled, and the mean over
placements), recall, precision and F1 of NLOS, ROC AUC, Brier score, expected calibration error, confusion and all of it
by placement; where labels are the four classes, their figures too. A reliability plot is put beside the JSON.

On the recording a model was trained on, these figures mean little: see the figures on its card, which are of
placements held out.

Examples:
  mine-loc evaluate-los build/site_c --model build/site.safetensors --json build/site_c.json
  mine-loc evaluate-los "$MINE_LOC_DATA/uwb_cirs_2018" --no-range --json build/no_range.json
"""

import argparse
import json
from pathlib import Path


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("data", type=Path, metavar="DATA", help="labelled recording")
    add("--model", type=Path, metavar="FILE", help="model (default: the one that is shipped)")
    add("--json", type=Path, required=True, metavar="OUT", help="figures; the plot goes to OUT with ending .png")
    add("--no-range", action="store_true", help="hide the measured ranges")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 when the figures are written."""
    import numpy as np  # noqa: PLC0415
    import torch  # noqa: PLC0415

    from mine_loc_bringup.los.recordings import read_recording  # noqa: PLC0415
    from mine_loc_bringup.los.report import figures_of, reliability_plot  # noqa: PLC0415
    from mine_loc_bringup.los.train import data_hash  # noqa: PLC0415
    from mine_loc_uwb.labelled_frames import training_set  # noqa: PLC0415
    from mine_loc_uwb.los_model_file import load_model, shipped_model  # noqa: PLC0415
    from mine_loc_uwb.los_training import log_probabilities  # noqa: PLC0415

    torch.set_num_threads(1)
    network, card = load_model(arguments.model or shipped_model())
    data, refused = training_set([read_recording(arguments.data)])
    given = data.input.without_range() if arguments.no_range else data.input
    judged = log_probabilities(network, given)
    figures = figures_of(judged, data.allowed, data.placement)
    report = figures | {
        "model": {name: card.get(name) for name in ("version", "sha256", "data")},
        "refused": dict(refused),
        "trained_on_this": data_hash(arguments.data) in card.get("data_sha256", []),
    }
    arguments.json.parent.mkdir(parents=True, exist_ok=True)
    arguments.json.write_text(json.dumps(report, indent=2, sort_keys=True) + "\n", "utf-8")
    reliability_plot(
        arguments.json.with_suffix(".png"), np.exp(judged[:, 2:]).sum(axis=1), data.los, arguments.data.name
    )
    if report["trained_on_this"]:
        print("the model was trained on this recording: the figures say how well it remembers, not how well it judges")
    for name, value in figures.items():
        if isinstance(value, float):
            print(f"  {name:28} {value:.3f}")
    print(f"written: {arguments.json}, {arguments.json.with_suffix('.png')}")
    return 0
