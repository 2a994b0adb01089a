"""The windows that the activity model is taught: all people of a folder of recordings, and simulated ones beside."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mine_loc_bringup.activity.recordings import recorded_windows, recording_names
from mine_loc_bringup.activity.simulated_walks import simulated_windows
from mine_loc_pdr.activity import ActivityKind
from mine_loc_pdr.activity_labels import LabelledWindow
from mine_loc_pdr.activity_training import Selection
from mine_loc_pdr.activity_window import BIN_NS, HOP_NS

SIMULATED_PEOPLE = 24
WALKED_S = 180.0
FIRST_SEED = 10_000  # those below are for scoring


def taught(windows: Sequence[LabelledWindow]) -> list[LabelledWindow]:
    """Those with a label, one a second: closer ones are near copies."""
    hop = HOP_NS // BIN_NS
    return [each for each in windows if each.label != ActivityKind.UNKNOWN and each.place % hop == 0]


def of_recordings(folder: Path) -> list[LabelledWindow]:
    """Every window of every recording in the folder."""
    return [window for name in recording_names(folder) for window in recorded_windows(folder, name)]


def simulated(seed: int, progress: Callable[[], None] | None = None) -> list[LabelledWindow]:
    """Every window of SIMULATED_PEOPLE people for training; other seeds (0 and up) are other people."""
    windows: list[LabelledWindow] = []
    for person in range(SIMULATED_PEOPLE):
        windows += simulated_windows(FIRST_SEED + seed * SIMULATED_PEOPLE + person, WALKED_S)
        if progress is not None:
            progress()
    return windows


def figures(chosen: Selection) -> dict[str, Any]:
    """For the card: what the cross-validation over people found at the chosen candidate."""
    judged = chosen.decisions > 0.0
    turning = chosen.turning
    return {
        "balanced_accuracy": round(chosen.accuracies[chosen.candidate], 5),
        "straight_accuracy": round(float(np.mean(~judged[~turning])), 5),
        "turn_accuracy": round(float(np.mean(judged[turning])), 5),
        "straight_windows": int((~turning).sum()),
        "turn_windows": int(turning.sum()),
    }
