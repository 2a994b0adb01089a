"""The recordings that dead reckoning is scored on, as samples in the order and at the times a device sent them."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from gait_recordings import RATE_HZ, Array
from scipy.io import loadmat

from mine_loc_bringup.recordings.ipol import PERIOD_NS, WALKED_M, names, read_trial
from mine_loc_core.stamps import to_ns

START_NS = 10**15
STANDARD_GRAVITY_M_S2 = 9.80665
Bout: TypeAlias = dict[str, Any]  # of walking, as mobgap's references describe it


@dataclass(frozen=True, slots=True)
class Recording:
    """Samples of one trial and its truth; times in s from START_NS."""

    name: str
    person: str
    stamps_ns: np.ndarray  # (n,)
    rate_rad_s: Array  # (n, 3), forward-left-up
    force_m_s2: Array  # (n, 3)
    strikes_s: Array  # marked heel strikes
    height_m: float | None = None
    bouts: list[tuple[float, float, float]] = field(default_factory=list)  # begin, end, metres walked, of the reference
    active: list[tuple[float, float]] = field(default_factory=list)  # when any reference saw walking
    turn: tuple[float, float] | None = None
    counted: int | None = None  # by a device beside, where strikes are not marked
    references: dict[str, list[Bout]] = field(default_factory=dict)  # by name

    @property
    def samples_s(self) -> Array:
        """Stamps in s from START_NS, (n,)."""
        return (self.stamps_ns - START_NS) * 1e-9


def folder(name: str) -> Path:
    """Of a public data set."""
    return Path(os.environ["MINE_LOC_DATA"]) / name


def ipol() -> Iterator[Recording]:
    """The rows as they came: packets lost stay lost, stamps are packet counters.

    The trial lies between its marked boundaries: after the end people go back as they like, and of those steps only
    some are marked.
    """
    data = folder("ipol_gait_lowerback") / "GaitData"
    for name in names(data):
        trial = read_trial(data, name)
        yield Recording(
            name,
            str(trial.subject),
            START_NS + trial.samples.counter * PERIOD_NS,
            trial.samples.rate_rad_s,
            trial.samples.force_m_s2,
            np.sort(np.concatenate([trial.left_strikes, trial.right_strikes])) / RATE_HZ,
            trial.height_m,
            [(trial.begin / RATE_HZ, trial.end / RATE_HZ, WALKED_M)],
            turn=(trial.turn_begin / RATE_HZ, trial.turn_end / RATE_HZ),
        )


def oxford() -> Iterator[Recording]:
    """Phones, no gyro: the rate is nought, so that gravity alone tells the vertical."""
    for path in sorted((folder("oxford_step_counter") / "validation").glob("*.csv.gz")):
        table = np.loadtxt(path, delimiter=",")
        name = path.name.rsplit("_", 1)[0]
        yield Recording(
            name,
            name.split("_")[0],
            START_NS + (table[:, 0] - table[0, 0]).astype(np.int64),
            np.zeros((len(table), 3)),
            table[:, 1:4],
            np.empty(0),
            counted=int(table[-1, 5] - table[0, 5]),
        )


def mobgap() -> Iterator[Recording]:
    """The trials for which a reference saw walking: INDIP's insoles, and motion capture where these saw none.

    Sensor X is up, Z forward. The people's heights are not given.
    """
    for path in sorted(folder("mobgap_lowerback").glob("example_data/data/lab/*/*/data.mat")):
        person = f"{path.parts[-3]}/{path.parts[-2]}"
        for test, trials in loadmat(path, simplify_cells=True)["data"]["TimeMeasure1"].items():
            for trial, content in trials.items() if isinstance(trials, dict) else ():
                references = {name: _bouts(content["Standards"][name]) for name in ("INDIP", "Stereophoto")}
                bouts = references["INDIP"] or references["Stereophoto"]
                if not bouts:
                    continue
                sensor = content["SU"]["LowerBack"]
                strikes = sorted(t for bout in bouts for t in np.atleast_1d(bout["InitialContact_Event"]))
                yield Recording(
                    f"{person} {test} {trial}",
                    person,
                    START_NS + np.arange(len(sensor["Acc"])) * to_ns(1.0 / RATE_HZ),
                    np.radians(sensor["Gyr"])[:, [2, 1, 0]] * np.array([1.0, -1.0, 1.0]),
                    sensor["Acc"][:, [2, 1, 0]] * np.array([1.0, -1.0, 1.0]) * STANDARD_GRAVITY_M_S2,
                    np.array([t for t in strikes if np.isfinite(t)]),
                    bouts=[(float(b["Start"]), float(b["End"]), float(b["Length"])) for b in bouts],
                    active=[(float(b["Start"]), float(b["End"])) for each in references.values() for b in each],
                    references=references,
                )


def _bouts(standard: dict[str, Any]) -> list[Bout]:
    found = standard["MicroWB"]
    return [bout for bout in (found if isinstance(found, list | np.ndarray) else [found]) if isinstance(bout, dict)]
