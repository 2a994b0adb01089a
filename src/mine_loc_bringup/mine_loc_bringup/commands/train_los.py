"""Train the LOS/NLOS classifier on labelled receptions and write a model for the node los_classifier.

DATA is one of
  a folder   with cir_iq.npz (cir: int16 [N, taps, 2]) and frames.csv, columns label, config, fp_idx, psc and, where
             known, rsl_dbm, fsl_dbm, dist_m, noise_std, channel, start_index
  a CSV      as eWINE's: NLOS, RANGE, FP_IDX, RXPACC, STDEV_NOISE, CH ... and magnitudes CIR0, CIR1 ...
  a bag      with uwb/cir, and labels on truth/link_state (mine-loc simulate --cir --bag writes one)

Labels are LOS, NLOS, NDP NLOS, or a class 1 to 4. Frames of one placement (config, or link of a bag) are near copies:
more placements help, more frames hardly. Simulated CM7, CM8 and CM4 links with all four classes train beside them; how
long to train, and the calibration, come from folds over placements. An interrupted run goes on where it was.

Examples:
  mine-loc train-los "$MINE_LOC_DATA/uwb_cirs_2018" --out build/los.safetensors
  mine-loc train-los build/site_a build/site_b --out build/site.safetensors --seed 2
"""

import argparse
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress

from mine_loc_core.errors import ConfigurationError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    add = parser.add_argument
    add("data", type=Path, nargs="+", metavar="DATA", help="labelled recordings, see above")
    add("--out", type=Path, required=True, metavar="FILE", help="model to write (safetensors)")
    add("--seed", type=int, default=1, metavar="K", help="of everything that is drawn (default 1)")
    add("--version", default="", metavar="TEXT", help="name of the model on its card (default: date and data)")
    add("--no-simulated", action="store_true", help="train on DATA alone")


def run(arguments: argparse.Namespace) -> int:
    """Exit status 0 when the model is written."""
    import torch  # noqa: PLC0415

    from mine_loc_bringup.los import train as runs  # noqa: PLC0415
    from mine_loc_bringup.los.recordings import read_recording  # noqa: PLC0415
    from mine_loc_bringup.los.report import inner_figures, reliability_plot  # noqa: PLC0415
    from mine_loc_uwb.labelled_frames import training_set  # noqa: PLC0415
    from mine_loc_uwb.los_model_file import save_model  # noqa: PLC0415
    from mine_loc_uwb.los_training import TrainingOptions  # noqa: PLC0415

    torch.set_num_threads(1)
    out: Path = arguments.out.resolve()
    data, refused = training_set([read_recording(path) for path in arguments.data])
    options = TrainingOptions()
    if len(set(data.placement[data.los])) < options.inner_folds or data.los.all():
        raise ConfigurationError(f"data: too few placements; allowed: {options.inner_folds} or more LOS ones, and NLOS")
    auxiliary = None if arguments.no_simulated else runs.simulated_links(arguments.seed)
    description = {
        "data": [runs.data_hash(path) for path in arguments.data],
        "seed": arguments.seed,
        "simulated": auxiliary is not None,
    }
    folder = runs.resume_folder(out, description)
    with Progress(console=Console(stderr=True)) as progress:
        task = progress.add_task("training", total=options.steps * runs.networks_to_train(options))
        network, chosen = runs.fit(
            data, options, arguments.seed, auxiliary, resume=folder, progress=lambda n: progress.advance(task, n)
        )
    card: dict[str, Any] = {
        "version": arguments.version or f"{datetime.now(UTC):%Y-%m-%d} {arguments.data[0].name}",
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
        "data": [path.name for path in arguments.data],
        "data_sha256": description["data"],
        "frames": len(data.input),
        "refused": dict(refused),
        "placements": len(set(data.placement)),
        "seed": arguments.seed,
        "simulated_links": 0 if auxiliary is None else runs.SIMULATED_LINKS,
        "steps": chosen.steps,
        "protocol": f"figures: {options.inner_folds} folds over placements, which also chose steps and temperature",
        "figures": inner_figures(chosen),
    }
    digest = save_model(out, network, card)
    runs.clear(folder)
    reliability_plot(out.with_suffix(".png"), chosen.los_probability[0], chosen.los, "placements held out")
    print(f"{out}: {out.stat().st_size / 1e3:.0f} kB, sha256 {digest[:16]}; reliability: {out.with_suffix('.png')}")
    for name, value in card["figures"].items():
        print(f"  {name:28} {value:.3f}")
    return 0
