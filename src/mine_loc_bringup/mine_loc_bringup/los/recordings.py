"""Labelled accumulators from what a user names: a folder, an eWINE-style CSV, or a bag."""

import csv
import itertools
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.cir_frames import CirFrames
from mine_loc_uwb.labelled_frames import LabelledFrames, allowed_classes

_MOST_FRAMES = 2_000_000
_FRAME_PERIOD_NS = 50_000_000
"""Frames without a time are taken for 20 a second."""
_USUAL_CHANNEL = 2
_REQUIRED = ("label", "config", "fp_idx", "psc")


def read_recording(path: Path) -> LabelledFrames:
    """Read DATA of `mine-loc train-los`. Raises ConfigurationError for what is none of the three kinds."""
    if (path / "frames.csv").is_file():
        return read_folder(path)
    if path.is_dir() and (path / "metadata.yaml").is_file():
        from mine_loc_bringup.nodes.labelled_bag import read_bag  # noqa: PLC0415 only here ROS is needed

        return read_bag(path)
    if path.is_file() and path.suffix.lower() == ".csv":
        return read_ewine(path)
    raise ConfigurationError(
        f"{path}: no labelled recording; allowed: a folder with cir_iq.npz and frames.csv, an eWINE-style CSV, a bag"
    )


def read_folder(path: Path) -> LabelledFrames:
    """Read `cir_iq.npz` (key cir: int16 (n, taps, 2)) and `frames.csv`, as uwb_cirs_2018."""
    rows, columns = read_rows(path / "frames.csv")
    missing = [name for name in _REQUIRED if name not in columns]
    if missing:
        raise ConfigurationError(
            f"{path / 'frames.csv'}: no column {missing[0]}; allowed: {', '.join(_REQUIRED)} needed"
        )
    samples = _samples(path / "cir_iq.npz", len(rows))
    config = [row["config"] for row in rows]
    placement = np.unique(config, return_inverse=True)[1]
    if all(name.lstrip("-").isdigit() for name in config):
        placement = np.array(config, int)
    frames = CirFrames(
        samples=samples,
        start_index=_column(rows, "start_index", 0.0).astype(int),
        first_path_index=_column(rows, "fp_idx"),
        symbols=_column(rows, "psc", 0.0),
        noise_std=_column(rows, "noise_std"),
        receive_power_dbm=_column(rows, "rsl_dbm"),
        first_path_power_dbm=_column(rows, "fsl_dbm"),
        range_m=_column(rows, "dist_m"),
        channel=_column(rows, "channel", _USUAL_CHANNEL).astype(int),
    )
    stamp_ns = np.arange(len(rows)) * _FRAME_PERIOD_NS
    return LabelledFrames(frames, allowed_classes([row["label"] for row in rows]), placement, config, stamp_ns)


def read_ewine(path: Path) -> LabelledFrames:
    """Read header columns NLOS, RANGE, FP_IDX, RXPACC and on, then magnitudes CIR0 and on: every frame a placement."""
    rows, columns = read_rows(path)
    names = list(itertools.takewhile(columns.__contains__, (f"CIR{number}" for number in range(1016))))
    missing = [name for name in ("NLOS", "FP_IDX", "CIR0") if name not in columns]
    if missing:
        raise ConfigurationError(f"{path}: no column {missing[0]}; allowed: an eWINE-style header")
    magnitude = np.array([[float(row[name]) for name in names] for row in rows])
    samples = np.zeros((len(rows), len(names), 2), np.int16)
    samples[..., 0] = np.clip(magnitude, 0, 32767)
    nothing = np.full(len(rows), np.nan)
    frames = CirFrames(
        samples=samples,
        start_index=np.zeros(len(rows), int),
        first_path_index=_column(rows, "FP_IDX"),
        symbols=_column(rows, "RXPACC", 0.0),
        noise_std=_column(rows, "STDEV_NOISE"),
        receive_power_dbm=nothing,
        first_path_power_dbm=nothing,
        range_m=_column(rows, "RANGE"),
        channel=_column(rows, "CH", _USUAL_CHANNEL).astype(int),
    )
    labels = ["NLOS" if float(row["NLOS"]) else "LOS" for row in rows]
    number = np.arange(len(rows))
    return LabelledFrames(frames, allowed_classes(labels), number, number.tolist(), number * _FRAME_PERIOD_NS)


def read_rows(path: Path) -> tuple[list[dict[str, str]], set[str]]:
    """Rows of a CSV and its columns. Raises ConfigurationError for a file of none or too many."""
    with path.open(newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        rows = list(itertools.islice(reader, _MOST_FRAMES + 1))
    if not 0 < len(rows) <= _MOST_FRAMES:
        raise ConfigurationError(f"{path}: {len(rows)} rows or more; allowed: 1 to {_MOST_FRAMES}")
    return rows, set(reader.fieldnames or ())


def _samples(path: Path, count: int) -> NDArray[np.int16]:
    try:
        samples = np.load(path, allow_pickle=False)["cir"]
    except (OSError, KeyError, ValueError) as error:
        raise ConfigurationError(f"{path}: cir cannot be read ({error}); allowed: int16 (frames, taps, 2)") from None
    if samples.dtype != np.int16 or samples.ndim != 3 or samples.shape[2] != 2 or len(samples) != count:
        raise ConfigurationError(
            f"{path}: cir is {samples.dtype} {samples.shape}; allowed: int16 ({count}, taps, 2), as frames.csv has rows"
        )
    return np.asarray(samples)


def _column(rows: list[dict[str, str]], name: str, absent: float = np.nan) -> NDArray[np.float64]:
    values = np.array([_number(row.get(name), absent) for row in rows])
    return np.where(np.isfinite(values), values, absent)


def _number(text: str | None, absent: float) -> float:
    try:
        return float(text) if text else absent
    except ValueError:
        return absent
