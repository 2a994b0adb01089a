"""Reading hanyang_outdoor_uwb: static ranges with tape truth, and runs with RTK truth."""

import csv
import gzip
import os
from pathlib import Path

import numpy as np

from mine_loc_bringup.recordings.hanyang import ANCHORS, read_exchanges, read_truth, run_folder
from mine_loc_uwb.range_pairs import RangePairs
from mine_loc_uwb.stamp_latency import TimedRanges

RUNS = ("LOS_A1", "LOS_B3", "NLOS_A1", "NLOS_B3")


def folder() -> Path:
    """The recording's folder under MINE_LOC_DATA."""
    return Path(os.environ["MINE_LOC_DATA"]) / "hanyang_outdoor_uwb"


def static_pairs() -> tuple[RangePairs, int]:
    """All static ranges, a group a distance, and how many rows are left out as not all their cells are numbers.

    A power of -inf is one that was not measured.
    """
    rows, left_out = [], 0
    with gzip.open(folder() / "static_all.csv.gz", "rt", newline="") as stream:
        for row in csv.DictReader(stream):
            try:
                numbers = {key: float(value) for key, value in row.items() if key != "los"}
            except ValueError:
                left_out += 1
                continue
            rows.append((numbers["Distance"], numbers["true_dist_m"], row["los"] == "NLOS", numbers["RSSI(dBm)"]))
    measured_m, true_m, nlos, power_dbm = np.array(rows).T
    group = np.unique(true_m, return_inverse=True)[1]
    power_dbm[~np.isfinite(power_dbm)] = np.nan
    return RangePairs(measured_m, true_m, nlos > 0.0, power_dbm, group), left_out


def timed_ranges(run: str) -> TimedRanges:
    """All ranges of a run and its true track."""
    path = run_folder(folder(), run)
    exchanges = read_exchanges(path)
    numbers = {int(name[1:]): number for number, name in enumerate(ANCHORS)}
    track_ns, track_m = read_truth(path)
    return TimedRanges(
        stamp_ns=np.array([each.at.stamp_ns for each in exchanges], np.int64),
        range_m=np.array([each.range_m for each in exchanges]),
        anchor=np.array([numbers[each.anchor_id] for each in exchanges], np.int64),
        anchor_m=np.array([each.anchor_m for each in exchanges]),
        track_ns=track_ns,
        track_m=track_m,
    )
