"""Pairs of measured and true range from a CSV file."""

import csv
import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.yaml_source import refuse
from mine_loc_uwb.range_pairs import RangePairs, groups_by_distance

MOST_ROWS = 200_000
_REQUIRED = ("measured_m", "true_m")
_OPTIONAL = ("label", "receive_power_dbm", "group")
_LABELS = {"LOS": False, "NLOS": True}


def read_csv(file: Path) -> RangePairs:
    """Read a file with the columns measured_m, true_m and, as it has them, label, receive_power_dbm, group.

    Without labels all links are taken to be without line of sight. Rows without a measured range (nan or empty) are
    left out. Raises ConfigurationError with one line a mistake: file, line, column, value, allowed.
    """
    rows: list[tuple[float, float, bool, float, str]] = []
    problems: list[str] = []
    try:
        with file.open(encoding="utf-8", newline="") as stream:
            reader = csv.DictReader(stream)
            _check_columns(file, reader.fieldnames or [])
            for row in reader:
                if len(rows) >= MOST_ROWS:
                    raise ConfigurationError(f"{file}: more than {MOST_ROWS} rows; allowed: fewer, or several files")
                try:
                    rows.append(_row(row))
                except ValueError as error:
                    problems.append(f"{file}:{reader.line_num}: {error}")
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigurationError(f"{file}: cannot be read as CSV: {error}") from error
    refuse(problems)
    kept = [row for row in rows if math.isfinite(row[0])]
    if not kept:
        raise ConfigurationError(f"{file}: no row with a measured range; allowed: at least one")
    measured_m, true_m, nlos, power_dbm, names = (np.array(column) for column in zip(*kept, strict=True))
    named = any(names)
    group = np.unique(names, return_inverse=True)[1] if named else groups_by_distance(true_m)
    return RangePairs(measured_m, true_m, nlos, power_dbm, group)


def _check_columns(file: Path, columns: object) -> None:
    names = list(columns) if isinstance(columns, list | tuple) else []
    for name in _REQUIRED:
        if name not in names:
            allowed = f"{', '.join(_REQUIRED)} and optionally {', '.join(_OPTIONAL)}"
            raise ConfigurationError(f"{file}:1: column {name} is missing among {names[:10]}; allowed: {allowed}")


def _row(row: Mapping[str, str | None]) -> tuple[float, float, bool, float, str]:
    """measured, true, NLOS, power, group of a row; raises ValueError naming column, value and what is allowed."""
    label = (row.get("label") or "NLOS").strip().upper()
    if label not in _LABELS:
        raise ValueError(f"label: {row['label']!r}; allowed: LOS or NLOS")
    true_m = _number(row, "true_m", 0.0, 1000.0)
    if not math.isfinite(true_m):
        raise ValueError(f"true_m: {row['true_m']!r}; allowed: 0 to 1000")
    measured_m = _number(row, "measured_m", -200.0, 1000.0)
    power_dbm = _number(row, "receive_power_dbm", -200.0, 50.0)
    return measured_m, true_m, _LABELS[label], power_dbm, (row.get("group") or "").strip()


def _number(row: Mapping[str, str | None], column: str, low: float, high: float) -> float:
    """A number, NaN for an empty cell; infinity, which devices write for no power, counts as empty."""
    text = (row.get(column) or "nan").strip()
    try:
        value = float(text)
    except ValueError:
        value = math.nan
        if text:
            raise ValueError(f"{column}: {text[:40]!r}; allowed: a number from {low:g} to {high:g}") from None
    if math.isinf(value):
        return math.nan
    if value < low or value > high:
        raise ValueError(f"{column}: {value:g}; allowed: {low:g} to {high:g}")
    return value
