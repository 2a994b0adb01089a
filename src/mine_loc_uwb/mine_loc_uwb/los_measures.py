"""Figures of merit of LOS/NLOS judgements, with frames pooled and with every placement weighing the same."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import rankdata

Reals = NDArray[np.float64]
Booleans = NDArray[np.bool_]
_BINS = 10


@dataclass(frozen=True, slots=True)
class Reliability:
    """Of the bins of a reliability plot that hold judgements: mean probability, share of LOS, number of judgements."""

    claimed: Reals
    found: Reals
    count: NDArray[np.int64]

    @property
    def expected_calibration_error(self) -> float:
        """Mean distance of claim and finding, weighted by judgements (Guo et al., ICML 2017, eq. 3, 10 equal bins)."""
        return float(np.abs(self.claimed - self.found) @ self.count / self.count.sum())


def reliability(probability: Reals, los: Booleans) -> Reliability:
    """Bin judgements (n,) by their probability."""
    which = np.minimum((probability * _BINS).astype(int), _BINS - 1)
    count = np.bincount(which, minlength=_BINS)
    used = count > 0
    sums = [np.bincount(which, weights=values, minlength=_BINS)[used] for values in (probability, los.astype(float))]
    return Reliability(sums[0] / count[used], sums[1] / count[used], count[used])


def area_under_curve(probability: Reals, los: Booleans) -> float:
    """Share of pairs of LOS and NLOS that are in order, ties half; NaN if there is only one kind."""
    positive = int(los.sum())
    pairs = positive * (len(los) - positive)
    rank = rankdata(probability)[los].sum() - 0.5 * positive * (positive + 1)
    return float(rank / pairs) if pairs else float("nan")


def binary_measures(probability: Reals, los: Booleans, placement: NDArray[np.int64]) -> dict[str, Any]:
    """Figures of LOS probabilities (n,) at the limit 1/2.

    `balanced_accuracy` pools the frames; `placement_balanced_accuracy` is the mean over LOS and over NLOS placements of
    the share of right frames. Recall, precision and F1 are those of NLOS, the kind that must not be missed.
    """
    said = probability > 0.5
    right = said == los
    missed, false = np.sum(said & ~los), np.sum(~said & los)
    caught = np.sum(~said & ~los)
    places = {int(place): float(right[placement == place].mean()) for place in np.unique(placement)}
    is_los = {place: bool(los[placement == place].mean() > 0.5) for place in places}
    kinds = [[share for place, share in places.items() if is_los[place] is kind] for kind in (True, False)]
    return {
        "accuracy": float(right.mean()),
        "balanced_accuracy": _mean([_mean(right[los]), _mean(right[~los])]),
        "placement_balanced_accuracy": _mean([_mean(kind) for kind in kinds]),
        "recall": _ratio(caught, caught + missed),
        "precision": _ratio(caught, caught + false),
        "f1": _ratio(2 * caught, 2 * caught + missed + false),
        "auc": area_under_curve(probability, los),
        "brier": float(np.mean((probability - los) ** 2)),
        "ece": reliability(probability, los).expected_calibration_error,
        "confusion": [[int(np.sum(said & los)), int(false)], [int(missed), int(caught)]],
        "placements": {
            str(place): {
                "los": is_los[place],
                "accuracy": share,
                "mean_los_probability": float(probability[placement == place].mean()),
                "frames": int(np.sum(placement == place)),
            }
            for place, share in places.items()
        },
    }


def class_measures(said: NDArray[np.int64], true: NDArray[np.int64], classes: int) -> dict[str, Any]:
    """Figures of classes 0 and on, (n,): recall and F1 are macro, `confusion` has a row for each true class."""
    confusion = np.zeros((classes, classes), int)
    np.add.at(confusion, (true, said), 1)
    right, truth, claims = np.diag(confusion), confusion.sum(axis=1), confusion.sum(axis=0)
    there = truth > 0
    return {
        "accuracy": float(right.sum() / confusion.sum()),
        "recall": float(np.mean(right[there] / truth[there])),
        "f1": float(np.mean(2 * right[there] / (truth + claims)[there])),
        "confusion": confusion.tolist(),
    }


def over_seeds(runs: list[Mapping[str, Any]]) -> dict[str, Any]:
    """Mean of every number over runs of different seeds, with `<name>_sd` beside it; other values of the first run."""
    out: dict[str, Any] = {}
    for name, value in runs[0].items():
        if isinstance(value, float):
            values = [run[name] for run in runs]
            out[name], out[f"{name}_sd"] = float(np.mean(values)), float(np.std(values, ddof=min(1, len(values) - 1)))
        else:
            out[name] = value
    return out


def _mean(values: Any) -> float:
    return float(np.mean(values)) if len(values) else float("nan")


def _ratio(part: Any, whole: Any) -> float:
    return float(part / whole) if whole else float("nan")
