"""Receptions over a grid of distance, loss and way round, as a table and as the bytes of a file."""

from dataclasses import dataclass, fields
from typing import IO

import numpy as np

from mine_loc_sim import radio_constants as constants
from mine_loc_sim.link_channel import Obstruction
from mine_loc_sim.ranging_link import Indices, Reals

DISTANCE_M = np.array([1.0, 2.5, 6.0, 15.0, 35.0, 80.0])
LOSS_DB = np.array([5.0, 10.0, 18.0, 30.0, 60.0])
DETOUR_M = np.array([0.0, 0.1, 0.5, 2.0, 8.0])
_SCATTERED_SLOPE_DB = 10.0 * constants.CM8.path_loss_exponent
ENTRIES = 32


@dataclass(frozen=True, slots=True)
class RangeLaw:
    """Table of receptions; `cells` = distances x (clear, losses x detours, sealed x detours)."""

    error_m: Reals  # (cells, entries), rising; NaN = lost
    link_class: Indices  # (cells, entries)
    level_dbm: Reals
    receive_power_dbm: Reals
    first_path_power_dbm: Reals
    white_sd_m: Reals  # (cells,), of ranges between ends at rest
    detour_m: Reals  # (cells,), that the errors were found with
    kept: float  # rank correlation of a link's error when only its fading has changed


def cell_of(way: Obstruction) -> Indices:
    """Cell of each link (n,), nearest on a logarithmic scale."""
    kinds = 1 + (len(LOSS_DB) + 1) * len(DETOUR_M)
    detour_m = np.minimum(way.detour_m, DETOUR_M[-1])
    loss = np.where(way.sealed, len(LOSS_DB), _nearest(LOSS_DB, way.loss_db))
    kind = np.where(way.loss_db > 0.0, 1 + loss * len(DETOUR_M) + _nearest(DETOUR_M + 0.05, detour_m + 0.05), 0)
    further = 10.0 ** (way.further_loss_db / _SCATTERED_SLOPE_DB)
    reach_m = (way.distance_m + detour_m) * further - detour_m
    distance_m = np.where(way.sealed & np.isfinite(way.detour_m), reach_m, way.distance_m)
    return _nearest(DISTANCE_M, distance_m) * kinds + kind


def _nearest(grid: Reals, values: Reals) -> Indices:
    borders = np.sqrt(grid[1:] * grid[:-1])
    return np.searchsorted(borders, values)


def write_law(law: RangeLaw, file: IO[bytes]) -> None:
    """Write a law; numbers lose what is beyond single precision."""
    columns = {field.name: np.asarray(getattr(law, field.name), np.float32) for field in fields(law)}
    np.savez_compressed(file, **{**columns, "link_class": law.link_class.astype(np.int8)})  # type: ignore[arg-type]


def read_law(file: IO[bytes]) -> RangeLaw:
    """Read what `write_law` has written."""
    with np.load(file, allow_pickle=False) as columns:
        numbers = {name: columns[name].astype(np.float64) for name in columns.files}
    return RangeLaw(**{**numbers, "link_class": numbers["link_class"].astype(np.int64), "kept": float(numbers["kept"])})
