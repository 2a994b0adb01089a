"""Picture of a range correction: the pairs it was fitted to before and after, and its polynomial."""

from pathlib import Path

import matplotlib as mpl
import numpy as np

from mine_loc_uwb.range_calibration import corrected_m
from mine_loc_uwb.range_correction import RangeCorrection
from mine_loc_uwb.range_pairs import RangePairs

mpl.use("Agg")
from matplotlib import pyplot as plt

_MOST_POINTS = 4000


def plot_correction(pairs: RangePairs, correction: RangeCorrection, file: Path) -> None:
    """Draw range errors over measured ranges, by label, before and after."""
    shown = np.zeros(len(pairs), bool)
    shown[:: -(-len(pairs) // _MOST_POINTS)] = True
    drawn = pairs.only(shown)
    figure, axes = plt.subplots(1, 2, figsize=(11, 4.5), sharey=True, layout="constrained")
    ranges = {"before": drawn.measured_m, "after, label known": corrected_m(correction, drawn)}
    for axis, (title, range_m) in zip(axes, ranges.items(), strict=True):
        for label, colour, kind in (("LOS", "tab:blue", ~drawn.nlos), ("NLOS", "tab:orange", drawn.nlos)):
            error_m = (range_m - drawn.true_m)[kind]
            axis.plot(drawn.measured_m[kind], error_m, ".", color=colour, markersize=3, label=label)
        axis.axhline(0.0, color="0.5", linewidth=0.8)
        axis.set(title=title, xlabel="measured range [m]")
    if correction.nlos is not None:
        clear_m = np.linspace(0.0, correction.nlos.valid_m[1] + 2.0, 400)
        axes[0].plot(clear_m, correction.nlos.correction_m(clear_m), "k", label="polynomial's correction")
    axes[0].set_ylabel("measured minus true [m]")
    axes[0].legend()
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=120)
    plt.close(figure)
