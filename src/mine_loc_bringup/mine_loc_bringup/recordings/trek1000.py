"""trek1000_bielefeld (Sang et al., WPNC 2019): a TREK1000 tag and four anchors, in a laboratory and in a sports hall.

Logs are rows of time of day HHMMSSmmm, tag, ranges to A0 … A3 in mm, 0 = not measured. In the laboratory Vicon measured
the tag beside them, on a clock and in a frame of its own; in the hall nobody did.
"""

import re
from dataclasses import dataclass
from math import nan
from pathlib import Path

import numpy as np
import scipy.io

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
)
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_uwb.ranging import Range, RangingRound

VICON_FRAME = "vicon"
PERSON = "walker"
_LAB = Path("exp_data", "UWB_data_Ranges")
_HALL = Path("exp_data", "Sporthall_data_Ranges")
_VICON = Path("exp_data", "Vicon_mat")
_LAB_ANCHORS_M = ((0.0, 0.0, 0.0), (5.77, 0.0, 0.0), (5.55, 5.69, 0.0), (0.0, 5.65, 0.0))
_HALL_HEIGHT_M = 1.2
_MIDNIGHT_NS = 1_543_446_000 * NS_PER_S
"""29 November 2018 in Bielefeld, the day of the laboratory by Vicon's clock; that of the hall is not told."""
_REPORTER = 1  # anchor A0 is the one on the serial line
_EXPECTED = "rows of HHMMSSmmm, tag and four ranges in mm"


@dataclass(frozen=True, slots=True, eq=False)
class Log:
    """Rounds of the tag: `ms_of_day` (n,) on the kit's local clock, ranges (n, 4) [m], NaN = not measured."""

    tag: int
    ms_of_day: Integers
    ranges_m: Array


def names(folder: Path) -> list[str]:
    """Of all recordings: `m1l`, `4vba0` … in the laboratory, `op1` … in the hall. Raises ConfigurationError if none."""
    return sorted(_logs(folder))


def read_log(path: Path) -> Log:
    """One log. Raises ConfigurationError for a file that is none."""
    try:
        rows = np.loadtxt(required(path, _EXPECTED), ndmin=2)
        tags = np.unique(rows[:, 1]).astype(int).tolist()
        ranges_m = rows[:, 2:6].reshape(-1, 4)
    except (OSError, ValueError, IndexError) as error:
        raise refused(path, error, _EXPECTED) from None
    if len(tags) != 1:
        raise refused(path, f"tags {tags}", "one tag a log")
    return Log(tags[0], _ms_of_day(rows[:, 0].astype(np.int64)), np.where(ranges_m > 0.0, ranges_m / 1e3, nan))


def read_vicon(path: Path) -> TrueTrack:
    """The track of Vicon, stamped by its own clock. Raises ConfigurationError for a file that is none."""
    try:
        rows = np.asarray(scipy.io.loadmat(required(path, "a Vicon recording"))["posedata_uwb"], np.float64)
        stamp_ns = rows[:, 1].astype(np.int64) * NS_PER_S + rows[:, 2].astype(np.int64)
        x, y, z, w = rows[:, 6:10].T
    except (OSError, ValueError, KeyError, IndexError, NotImplementedError) as error:
        raise refused(path, error, "a matrix posedata_uwb of ten columns") from None
    stamp_ns, rising = np.unique(stamp_ns, return_index=True)
    return TrueTrack(PERSON, VICON_FRAME, stamp_ns, rows[rising, 3:6], np.column_stack([w, x, y, z])[rising])


def vicon_file(folder: Path, name: str) -> Path | None:
    """The track that belongs to a recording; None where nobody measured it."""
    found = [path for path in (folder / _VICON).glob("*.mat") if path.stem.lower() == name]
    return found[0] if found else None


def round_of(number: int, ms: int, tag: int, ranges_m: Array) -> RangingRound:
    """One row as the kit reports it; ids are the kit's numbers plus one, as 0 means none."""
    ranges = [Range(index + 1, float(range_m)) for index, range_m in enumerate(ranges_m)]
    return RangingRound(tag + 1, _REPORTER, number % 256, ms, tuple(ranges), corrected=True)


def load(folder: Path, name: str) -> Recording:
    """One recording, stamped by the kit's clock, its truth by Vicon's; the two clocks are seconds apart."""
    log = read_log(_logs(folder)[name])
    stamps_ns = _MIDNIGHT_NS + log.ms_of_day * NS_PER_MS
    rounds = [
        (Instant(stamp_ns, stamp_ns), round_of(number, ms, log.tag, row))
        for number, (stamp_ns, ms, row) in enumerate(
            zip(stamps_ns.tolist(), log.ms_of_day.tolist(), log.ranges_m, strict=True)
        )
    ]
    vicon = vicon_file(folder, name)
    return Recording(
        name,
        _site(_logs(folder)[name]),
        [{"name": PERSON, "tag_id": log.tag + 1, "height_m": 1.75}],
        rounds,
        tracks=[read_vicon(vicon)] if vicon else [],
        links=_links(name, log, stamps_ns),
    )


def _logs(folder: Path) -> dict[str, Path]:
    found = {path.stem.removeprefix("output_range_uwb_"): path for path in (folder / _LAB).glob("output_range_*.txt")}
    found |= {path.stem.split("_")[0]: path for path in (folder / _HALL).glob("op*_Ranges_*.txt")}
    if not found:
        raise refused(
            folder, f"no {_LAB}/output_range_uwb_*.txt", "the folder of positioning-algorithms-for-uwb-matlab"
        )
    return found


def _site(path: Path) -> dict[str, object]:
    anchors_m, site, tag_height_m = list(_LAB_ANCHORS_M), "trek_lab", 0.0
    if hall := re.match(r"op\d+_Ranges_(20|40)_20", path.name):
        long_m, z = float(hall[1]), _HALL_HEIGHT_M
        anchors_m = [(0.0, 0.0, z), (20.0, 0.0, z), (20.0, long_m, z), (0.0, long_m, z)]
        site, tag_height_m = f"trek_hall_{hall[1]}", z
    numbered: dict[int, Vector3] = dict(enumerate(anchors_m, start=1))
    return site_content(site, numbered, tag_height_m=tag_height_m, names={i: f"A{i - 1}" for i in numbered})


def _links(name: str, log: Log, stamps_ns: Integers) -> list[LabelledLink]:
    """Labels of the recordings at rest: `4vbaK` has a person between the tag and anchor K, `4vnm` nobody anywhere."""
    blocked = re.fullmatch(r"4vba(\d)2?s?", name)
    if not blocked and not re.fullmatch(r"4vnm2?", name):
        return []
    hidden = int(blocked[1]) + 1 if blocked else 0
    labels = {a: (False, True, False, False) if a == hidden else (False, False, True, True) for a in range(1, 5)}
    return [
        LabelledLink(stamp_ns, log.tag + 1, anchor, allowed)
        for stamp_ns in stamps_ns.tolist()
        for anchor, allowed in labels.items()
    ]


def _ms_of_day(hhmmssmmm: Integers) -> Integers:
    hours, minutes, ms = hhmmssmmm // 10_000_000, hhmmssmmm // 100_000 % 100, hhmmssmmm % 100_000
    return np.asarray((hours * 60 + minutes) * 60_000 + ms, dtype=np.int64)
