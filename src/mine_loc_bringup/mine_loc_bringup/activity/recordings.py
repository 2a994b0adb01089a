"""Labelled windows of recordings like ipol_gait_lowerback: stand, walk, U-turn, walk back, stop.

A recording is NAME.json (Subject, TrialBoundaries, UTurnBoundaries as sample indices) and NAME_lb.txt.gz, see
`recordings/ipol.py`.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mine_loc_bringup.activity.windows import windows_of
from mine_loc_bringup.recordings.ipol import PERIOD_NS, read_samples
from mine_loc_core.errors import ConfigurationError
from mine_loc_pdr.activity_labels import LabelledWindow, MarkedWalk, label_marked
from mine_loc_pdr.activity_window import BIN_NS, WINDOW_NS

_START_NS = 10**15


def recording_names(folder: Path) -> list[str]:
    """Names of the recordings in a folder, or ConfigurationError where there are none."""
    names = sorted(path.stem for path in folder.glob("*.json") if (folder / f"{path.stem}_lb.txt.gz").is_file())
    if not names:
        raise ConfigurationError(f"{folder}: no recordings; allowed: a folder of NAME.json with NAME_lb.txt.gz")
    return names


def marks(folder: Path, name: str) -> tuple[str, MarkedWalk]:
    """Who walked, and the marked instants on the clock of the windows."""
    path = folder / f"{name}.json"
    try:
        truth: dict[str, Any] = json.loads(path.read_text("utf-8"))
        (begin, end), (turn_begin, turn_end) = truth["TrialBoundaries"], truth["UTurnBoundaries"]
        instants = [_START_NS + int(each) * PERIOD_NS for each in (begin, turn_begin, turn_end, end)]
        return f"recorded {truth['Subject']}", MarkedWalk(*instants)
    except (ValueError, KeyError, TypeError) as error:
        raise ConfigurationError(f"{path}: {error!r}; allowed: Subject, TrialBoundaries, UTurnBoundaries") from None


def recorded_windows(folder: Path, name: str) -> Iterator[LabelledWindow]:
    """Every window of a recording; place 0 is the first that begins within the walk."""
    person, walk = marks(folder, name)
    samples = read_samples(folder, name)
    stamps_ns = _START_NS + samples.counter * PERIOD_NS
    windows = list(windows_of(stamps_ns, samples.rate_rad_s, samples.force_m_s2))
    first_bin = -(-walk.begin_ns // BIN_NS)
    for window in windows:
        begin_ns = window.end_ns - WINDOW_NS
        kind = label_marked(begin_ns, window.end_ns, walk)
        yield LabelledWindow(person, name, begin_ns // BIN_NS - first_bin, window, kind)
