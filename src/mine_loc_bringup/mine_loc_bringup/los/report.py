"""Reports on LOS judgements: figures for a model card, and the plots of an evaluation."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from mine_loc_uwb.los_measures import binary_measures, class_measures, reliability
from mine_loc_uwb.los_training import Selection

mpl.use("Agg")
import matplotlib.pyplot as plt

_CARD_FIGURES = ("accuracy", "balanced_accuracy", "placement_balanced_accuracy", "auc", "ece", "brier")


def inner_figures(chosen: Selection) -> dict[str, float]:
    """Figures of the inner folds at the chosen step, with and without range (`_no_range`)."""
    pairs = (("", chosen.los_probability[0]), ("_no_range", chosen.los_probability[1]))
    figures = {ending: binary_measures(probability, chosen.los, chosen.placement) for ending, probability in pairs}
    return {name + ending: figures[ending][name] for ending, _ in pairs for name in _CARD_FIGURES}


def reliability_plot(path: Path, probability: NDArray[np.float64], los: NDArray[np.bool_], title: str) -> None:
    """Share of LOS against claimed probability, with the number of judgements below."""
    bins = reliability(probability, los)
    figure, (top, bottom) = plt.subplots(
        2, 1, figsize=(4.5, 5.0), sharex=True, gridspec_kw={"height_ratios": [3, 1]}, layout="constrained"
    )
    top.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    top.plot(bins.claimed, bins.found, marker="o")
    top.set(ylabel="share of LOS", title=f"{title}: ECE {bins.expected_calibration_error:.3f}", ylim=(0, 1))
    bottom.hist(probability, bins=10, range=(0, 1), color="0.5")
    bottom.set(xlabel="claimed LOS probability", ylabel="frames", xlim=(0, 1))
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def figures_of(
    log_probability: NDArray[np.float64], allowed: NDArray[np.bool_], placement: NDArray[np.int64]
) -> dict[str, Any]:
    """Figures of class log-probabilities (n, 4): LOS against NLOS, and of four classes where all labels name one."""
    probability = np.exp(log_probability)
    los = np.asarray(allowed[:, 2:].any(axis=1))
    figures = binary_measures(probability[:, 2:].sum(axis=1), los, placement)
    if (allowed.sum(axis=1) == 1).all():
        figures["four_class"] = class_measures(probability.argmax(axis=1), allowed.argmax(axis=1), 4)
    return figures
