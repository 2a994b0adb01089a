"""The runs of hanyang_outdoor_uwb (Sci. Data 2025, doi 10.1038/s41597-025-05887-9): four anchors, a tag, RTK truth.

A file an anchor: arrival and stamp [ns], the anchor's place, range [m], powers [dBm]. The stamps are late against the
truth by 0.15 to 0.2 s, which `mine-loc fit-ranges` measures; truth is in the frame of the anchors, its height relative.
"""

import csv
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mine_loc_bringup.recordings.public_data import refused, required
from mine_loc_bringup.recordings.recording import (
    Array,
    Instant,
    Integers,
    LabelledLink,
    Recording,
    TrueTrack,
    Vector3,
    site_content,
    upright,
)
from mine_loc_core.stamps import NS_PER_MS
from mine_loc_uwb.ranging import Range, RangingRound

PERSON = "carrier"
ANCHORS = ("A3", "A5", "A9", "A12")
_TAG = 1
_TAG_HEIGHT_M = 1.0
"""About where the authors' own tracks lie; the height is not told."""
_RUNS = Path("Dynamic_measurements")
_LONGEST_ROUND_NS = 50 * NS_PER_MS
"""Anchors answer one after the other within 4 ms; rounds follow each other every 100 ms."""
_EXCHANGE = "a CSV with %time, field.stamp, field.id, field.x, y, z, field.distanceFromTag, field.rssi, field.rssi_fp"
_TRUTH = "a CSV with timestamp, x, y, z"


@dataclass(frozen=True, slots=True)
class Exchange:
    """One range of one anchor; powers as the radio reports them."""

    at: Instant
    anchor_id: int
    anchor_m: Vector3
    range_m: float
    receive_power_dbm: float
    first_path_power_dbm: float


def names(folder: Path) -> list[str]:
    """Of all runs, such as `LOS_A1`. Raises ConfigurationError if there are none."""
    return sorted(_runs(folder))


def run_folder(folder: Path, name: str) -> Path:
    """Where the files of a run lie."""
    return _runs(folder)[name]


def read_exchanges(path: Path) -> list[Exchange]:
    """All ranges of a run in order of arrival. Raises ConfigurationError for a file that is missing or wrong."""
    found = [each for anchor in ANCHORS for each in _exchanges(path / f"{anchor}.csv")]
    return sorted(found, key=lambda each: each.at.arrival_ns)


def read_truth(path: Path) -> tuple[Integers, Array]:
    """Stamps (n,) that increase, and places (n, 3) [m], of `trajectory.csv`."""
    file = path / "trajectory.csv"
    try:
        with required(file, _TRUTH).open(newline="", encoding="utf-8") as stream:
            rows = [(int(float(r["timestamp"])), *(float(r[axis]) for axis in "xyz")) for r in csv.DictReader(stream)]
    except (KeyError, ValueError, TypeError) as error:
        raise refused(file, repr(error), _TRUTH) from None
    stamp_ns, rising = np.unique(np.array([row[0] for row in rows], np.int64), return_index=True)
    return stamp_ns, np.array([row[1:] for row in rows], np.float64).reshape(-1, 3)[rising]


def load(folder: Path, name: str) -> Recording:
    """One run. Links of LOS runs are known to be in line of sight; which are hidden when in the others is not told."""
    path = run_folder(folder, name)
    exchanges = read_exchanges(path)
    stamp_ns, position_m = read_truth(path)
    clear = (False, False, True, True)
    return Recording(
        name,
        site_content("hanyang", {each.anchor_id: each.anchor_m for each in exchanges}, tag_height_m=_TAG_HEIGHT_M),
        [{"name": PERSON, "tag_id": _TAG, "height_m": 1.75}],
        list(_rounds(exchanges)),
        tracks=[TrueTrack(PERSON, "map", stamp_ns, position_m, upright(len(stamp_ns)))],
        links=[LabelledLink(each.at.stamp_ns, _TAG, each.anchor_id, clear) for each in exchanges]
        if name.startswith("LOS")
        else [],
    )


def _runs(folder: Path) -> dict[str, Path]:
    found = {
        f"{path.parts[-3]}_{path.parts[-2][-1]}{path.name.removeprefix('Case_')}": path
        for path in (folder / _RUNS).glob("*LOS/Trajectory_?/Case_*")
    }
    if not found:
        raise refused(folder, f"no {_RUNS}/LOS/Trajectory_A/Case_1", "the folder of UWB-dataset")
    return found


def _exchanges(file: Path) -> Iterable[Exchange]:
    try:
        with required(file, _EXCHANGE).open(newline="", encoding="utf-8") as stream:
            return [_exchange(row) for row in csv.DictReader(stream)]
    except (KeyError, ValueError, TypeError) as error:
        raise refused(file, repr(error), _EXCHANGE) from None


def _exchange(row: dict[str, str]) -> Exchange:
    stamp_ns = int(row["field.stamp"])
    return Exchange(
        Instant(stamp_ns, max(stamp_ns, int(row["%time"]))),
        int(row["field.id"]),
        (float(row["field.x"]), float(row["field.y"]), float(row["field.z"])),
        float(row["field.distanceFromTag"]),
        float(row["field.rssi"]),
        float(row["field.rssi_fp"]),
    )


def _rounds(exchanges: list[Exchange]) -> Iterable[tuple[Instant, RangingRound]]:
    """Exchanges put together to rounds: each anchor once, and all soon after the first."""
    taken: list[Exchange] = []
    number = 0
    for each in exchanges:
        late = taken and each.at.stamp_ns - taken[0].at.stamp_ns > _LONGEST_ROUND_NS
        if late or each.anchor_id in {other.anchor_id for other in taken}:
            yield _round(number, taken)
            taken, number = [], number + 1
        taken.append(each)
    if taken:
        yield _round(number, taken)


def _round(number: int, exchanges: list[Exchange]) -> tuple[Instant, RangingRound]:
    """Stamped in the middle, known when its last range is."""
    stamps = [each.at.stamp_ns for each in exchanges]
    stamp_ns = (min(stamps) + max(stamps)) // 2
    ranges = tuple(
        Range(
            each.anchor_id,
            each.range_m,
            first_path_power_dbm=each.first_path_power_dbm,
            receive_power_dbm=each.receive_power_dbm,
            ticks_offset=each.at.stamp_ns - stamp_ns,
        )
        for each in exchanges
    )
    at = Instant(stamp_ns, max(each.at.arrival_ns for each in exchanges))
    return at, RangingRound(_TAG, _TAG, number, None, ranges, corrected=False)
