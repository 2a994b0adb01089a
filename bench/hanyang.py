"""Reading hanyang_outdoor_uwb: static ranges with tape truth, and runs with RTK truth."""

import csv
import gzip
import os
from pathlib import Path

import numpy as np

from mine_loc_uwb.range_pairs import RangePairs
from mine_loc_uwb.stamp_latency import TimedRanges

RUNS = {
    "LOS_A1": "LOS/Trajectory_A/Case_1",
    "LOS_B3": "LOS/Trajectory_B/Case_3",
    "NLOS_A1": "NLOS/Trajectory_A/Case_1",
    "NLOS_B3": "NLOS/Trajectory_B/Case_3",
}
ANCHORS = ("A3", "A5", "A9", "A12")


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
    path = folder() / "Dynamic_measurements" / RUNS[run]
    rows = []
    for number, name in enumerate(ANCHORS):
        with (path / f"{name}.csv").open(newline="") as stream:
            for row in csv.DictReader(stream):
                place_m = tuple(float(row[f"field.{axis}"]) for axis in "xyz")
                rows.append((int(row["field.stamp"]), float(row["field.distanceFromTag"]), number, place_m))
    with (path / "trajectory.csv").open(newline="") as stream:
        track = sorted(
            (int(float(r["timestamp"])), *(float(r[axis]) for axis in "xyz")) for r in csv.DictReader(stream)
        )
    return TimedRanges(
        stamp_ns=np.array([row[0] for row in rows], np.int64),
        range_m=np.array([row[1] for row in rows]),
        anchor=np.array([row[2] for row in rows], np.int64),
        anchor_m=np.array([row[3] for row in rows]),
        track_ns=np.array([row[0] for row in track], np.int64),
        track_m=np.array([row[1:] for row in track]),
    )
