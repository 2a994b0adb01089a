"""ipol_gait_lowerback (Voisard et al., IPOL 2023): people with an IMU at the lower back walk there and back.

A trial is NAME.json (who, and marks as sample indices) and NAME_lb.txt, packed as .gz or not: a line on the rate, a
heading, then rows of packet counter, force X Y Z in m/s², rate X Y Z in rad/s, magnetic field X Y Z in arbitrary units.
Sensor X is up, Z backwards (the speed gained in the first second of walking is negative along Z for every subject).
Rows of lost packets are missing; the marks count packets.
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mine_loc_bringup.recordings.public_data import refused, required
from mine_loc_bringup.recordings.recording import (
    START_NS,
    Array,
    Integers,
    MarkedStep,
    Recording,
    site_content,
)
from mine_loc_core.stamps import NS_PER_MS
from mine_loc_pdr.n100_stream import ImuMeasurement

PERIOD_NS = 10 * NS_PER_MS
WALKED_M = 20.0
"""Both ways, by the protocol."""
PERSON = "walker"
_USUAL_HEIGHT_M = 1.70
_UNIT_FIELD_T = 48e-6
"""The sensor's unit is the field where it was calibrated, about this in Western Europe; only the direction counts."""
_FLU = np.array([-1.0, 1.0, 1.0])  # of the columns Z, Y, X
_MARKS = "a JSON mapping with Subject, Height, TrialBoundaries, UTurnBoundaries, LeftFootEvents, RightFootEvents"
_SAMPLES = "rows of seven numbers (packet counter, force, rate), or ten with the magnetic field"


@dataclass(frozen=True, slots=True, eq=False)
class Samples:
    """Samples at packet counters (n,), 10 ms each, of which none repeats. Axes are forward-left-up."""

    counter: Integers  # (n,)
    force_m_s2: Array  # (n, 3)
    rate_rad_s: Array  # (n, 3)
    field: Array  # (n, 3), of the unit length that the field had where the sensor was calibrated; NaN = not measured


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """One trial; instants are packet counters."""

    subject: int
    number: int
    height_m: float | None
    samples: Samples
    begin: int
    turn_begin: int
    turn_end: int
    end: int
    left_strikes: Integers
    right_strikes: Integers

    @property
    def strikes(self) -> Integers:
        """Of both feet within the trial: after it people go back as they like, and not all steps are marked."""
        both = np.sort(np.concatenate([self.left_strikes, self.right_strikes]))
        return both[(both >= self.begin) & (both <= self.end)]


def names(folder: Path) -> list[str]:
    """Of all trials, `subject-trial`, by number. Raises ConfigurationError if there are none."""
    data = _data(folder)
    found = [path.stem for path in data.glob("*-*.json") if any(data.glob(f"{path.stem}_lb.txt*"))]
    if not found:
        raise refused(data, "no trials", "a folder of NAME.json with NAME_lb.txt.gz")
    return sorted(found, key=lambda name: [int(part) if part.isdigit() else 0 for part in name.split("-")])


def read_trial(folder: Path, name: str) -> Trial:
    """Read a trial. Raises ConfigurationError for a file that is missing or wrong."""
    path = _data(folder) / f"{name}.json"
    try:
        marks: dict[str, Any] = json.loads(required(path, _MARKS).read_text("utf-8"))
        (begin, end), (turn_begin, turn_end) = marks["TrialBoundaries"], marks["UTurnBoundaries"]
        left, right = (np.array([e for _, e in marks[f"{foot}FootEvents"]], np.int64) for foot in ("Left", "Right"))
        subject, number, height_cm = int(marks["Subject"]), int(marks["Trial"]), float(marks["Height"])
    except (ValueError, KeyError, TypeError) as error:
        raise refused(path, repr(error), _MARKS) from None
    return Trial(
        subject,
        number,
        None if math.isnan(height_cm) else height_cm / 100.0,
        read_samples(_data(folder), name),
        int(begin),
        int(turn_begin),
        int(turn_end),
        int(end),
        left,
        right,
    )


def read_samples(data: Path, name: str) -> Samples:
    """Samples of a trial in `data`. Raises ConfigurationError for a file that is missing or wrong."""
    packed, plain = (data / f"{name}_lb.txt{ending}" for ending in (".gz", ""))
    path = plain if plain.is_file() and not packed.is_file() else packed
    try:
        table = np.loadtxt(required(path, _SAMPLES), skiprows=2, ndmin=2)
        table = table[np.unique(table[:, 0], return_index=True)[1]]
        force, rate = table[:, [3, 2, 1]] * _FLU, table[:, [6, 5, 4]] * _FLU
    except (OSError, EOFError, ValueError, IndexError) as error:
        raise refused(path, error, _SAMPLES) from None
    field = table[:, [9, 8, 7]] * _FLU if table.shape[1] > 9 else np.full_like(force, np.nan)
    return Samples(table[:, 0].astype(np.int64), force, rate, field)


def load(folder: Path, name: str) -> Recording:
    """One trial: samples of the IMU and the marked heel strikes; where the person is, is not known."""
    trial = read_trial(folder, name)
    measured = trial.samples
    stamps_ns = START_NS + measured.counter * PERIOD_NS
    columns = (stamps_ns, measured.rate_rad_s, measured.force_m_s2, measured.field * _UNIT_FIELD_T)
    rows = zip(*(column.tolist() for column in columns), strict=True)
    samples = [(at_ns, ImuMeasurement(at_ns, tuple(w), tuple(a), tuple(m), None, None)) for at_ns, w, a, m in rows]
    walker = {
        "name": PERSON,
        "tag_id": 0,
        "height_m": trial.height_m or _USUAL_HEIGHT_M,
        "n100": {"port": f"/dev/null/{PERSON}/n100"},
    }
    return Recording(
        name,
        site_content("ipol_gait", {}, tag_height_m=1.0),
        [walker],
        imu={PERSON: samples},
        steps=[MarkedStep(PERSON, stamp_ns) for stamp_ns in (START_NS + trial.strikes * PERIOD_NS).tolist()],
    )


def _data(folder: Path) -> Path:
    return folder / "GaitData" if (folder / "GaitData").is_dir() else folder
