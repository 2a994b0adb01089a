"""Hand features of DW1000 accumulators and a logistic classifier, the same for real and simulated receptions."""

import csv
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from mine_loc_uwb.delay_features import delay_features

_BEFORE, _AFTER = 16, 112
_EVERY = 8  # neighbouring frames of one placement are near copies


@dataclass(frozen=True, slots=True)
class Receptions:
    """Features (n, f), whether the direct path is obstructed or absent (n,), and the placement of each (n,)."""

    features: NDArray[np.float64]
    obstructed: NDArray[np.bool_]
    placement: NDArray[np.int64]


def features(
    magnitude: NDArray[np.float32],
    first_path_index: NDArray[np.float64],
    symbols: NDArray[np.int64],
    receive_power_dbm: NDArray[np.float64],
    first_path_power_dbm: NDArray[np.float64],
) -> NDArray[np.float64]:
    """RX-FP, mean excess, RMS spread, peak delay, kurtosis, rise, early share (and in dB), peak/noise, RXPACC, RX."""
    floor = np.floor(first_path_index).astype(int)
    columns = np.clip(floor[:, None] + np.arange(-_BEFORE, _AFTER), 0, magnitude.shape[1] - 1)
    window = np.take_along_axis(magnitude, columns, axis=1).astype(float)
    noise = np.sqrt((magnitude[:, 64:700].astype(float) ** 2).mean(axis=1))
    delays = delay_features(window, _BEFORE, floor - _BEFORE - first_path_index, noise)
    return np.column_stack([receive_power_dbm - first_path_power_dbm, delays, np.log(symbols), receive_power_dbm])


def read_real(folder: Path) -> Receptions:
    """Read every eighth frame of uwb_cirs_2018."""
    with (folder / "frames.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))[::_EVERY]
    samples = np.load(folder / "cir_iq.npz")["cir"][::_EVERY].astype(np.float32)

    def column(name: str) -> NDArray[np.float64]:
        return np.array([float(row[name] or "nan") for row in rows])

    known = np.isfinite(column("rsl_dbm")) & np.isfinite(column("fsl_dbm"))
    values = [column(name)[known] for name in ("fp_idx", "psc", "rsl_dbm", "fsl_dbm")]
    found = features(np.hypot(samples[..., 0], samples[..., 1])[known], *values)
    return Receptions(
        found, np.array([row["label"] != "LOS" for row in rows])[known], column("config")[known].astype(int)
    )


def fit(train: Receptions) -> Callable[[NDArray[np.float64]], NDArray[np.bool_]]:
    """Logistic regression with a small ridge, both labels weighing the same; returns the decision."""
    middle, scale = train.features.mean(axis=0), train.features.std(axis=0)
    sign = np.where(train.obstructed, 1.0, -1.0)
    share = train.obstructed.mean()
    weight = np.where(train.obstructed, 0.5 / share, 0.5 / (1.0 - share))

    def design(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.column_stack([(values - middle) / scale, np.ones(len(values))])

    rows = design(train.features)

    def loss(w: NDArray[np.float64]) -> float:
        return float(np.mean(weight * np.logaddexp(0.0, -sign * (rows @ w))) + 1e-2 * w[:-1] @ w[:-1])

    solution = minimize(loss, np.zeros(rows.shape[1])).x
    return lambda values: design(values) @ solution > 0.0


def balanced_accuracy(said: NDArray[np.bool_], true: NDArray[np.bool_]) -> float:
    """Mean of both labels' recalls."""
    return float(0.5 * (said[true].mean() + (~said[~true]).mean()))


def leave_one_placement_out(data: Receptions) -> float:
    """Balanced accuracy of pooled decisions on placements not trained on."""
    said = np.zeros(len(data.obstructed), bool)
    for placement in np.unique(data.placement):
        held = data.placement == placement
        rest = Receptions(data.features[~held], data.obstructed[~held], data.placement[~held])
        said[held] = fit(rest)(data.features[held])
    return balanced_accuracy(said, data.obstructed)
