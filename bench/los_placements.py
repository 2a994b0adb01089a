"""Plot the placements that the classifier gets wrong beside the ones of the other kind that they resemble most.

Reads the per-placement figures of bench/results/los.json and writes docs/images/los_placements.png: a row for each
placement that fails with the range or without it, its accumulators on the left, its neighbour's on the right.
"""

import argparse
import json
import os
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from mine_loc_bringup.los.recordings import read_recording
from mine_loc_uwb.labelled_frames import training_set
from mine_loc_uwb.los_evidence import FIRST_POWER, NOISE, POWER

mpl.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).parent
FAILS_BELOW = 0.5
EVERY, TAPS = 12, slice(12, 64)


def failing(figures: dict[str, Any]) -> list[int]:
    """Numbers of the placements that fail with the range or without."""
    places = [figures[part]["placements"].items() for part in ("real", "real_no_range")]
    return sorted({int(name) for part in places for name, each in part if each["accuracy"] < FAILS_BELOW})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path, default=HERE / "results" / "los.json", help="figures of bench/los.py")
    parser.add_argument("--out", type=Path, default=HERE.parent / "docs" / "images" / "los_placements.png")
    arguments = parser.parse_args()
    wrong = failing(json.loads(arguments.json.read_text()))
    frames = read_recording(Path(os.environ["MINE_LOC_DATA"]) / "uwb_cirs_2018")
    data, _ = training_set([frames])
    places = np.unique(data.placement)
    seen = np.array(
        [np.nanmedian(data.input.side[data.placement == p][:, [POWER, FIRST_POWER, NOISE]], axis=0) for p in places]
    )
    los = {place: bool(data.los[data.placement == place][0]) for place in places.tolist()}
    figure, axes = plt.subplots(
        len(wrong), 2, figsize=(8, 1.9 * len(wrong)), sharex=True, squeeze=False, layout="constrained"
    )
    for row, place in zip(axes, wrong, strict=True):
        distance = np.linalg.norm((seen - seen[places == place]) / seen.std(axis=0), axis=1)
        others = [number for number in np.argsort(distance) if los[int(places[number])] is not los[place]]
        for axis, shown in zip(row, (place, int(places[others[0]])), strict=True):
            which = np.flatnonzero(data.placement == shown)
            power_db, first_db, _ = seen[places == shown][0]
            axis.plot(
                np.arange(TAPS.start - 16, TAPS.stop - 16), data.input.profile[which[::EVERY], 0, TAPS].T, linewidth=0.4
            )
            axis.set_title(
                f"{shown}: {'LOS' if los[shown] else 'NLOS'}, {np.nanmedian(frames.frames.range_m[which]):.2f} m; "
                f"against free space {power_db:+.1f} dB, first path {first_db:+.1f} dB",
                fontsize=8,
            )
            axis.tick_params(labelsize=7)
    for axis in axes[-1]:
        axis.set_xlabel("taps after the first path", fontsize=8)
    figure.suptitle("judged wrongly (left) and the likeliest of the other kind (right), |z| / peak", fontsize=9)
    arguments.out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(arguments.out, dpi=80)


if __name__ == "__main__":
    main()
