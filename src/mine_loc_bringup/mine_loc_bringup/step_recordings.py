"""Marked walks of which the step network is taught, of a folder like ipol_gait_lowerback."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from mine_loc_bringup.activity.recordings import recording_names
from mine_loc_bringup.recordings.ipol import PERIOD_NS, read_samples
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_MS
from mine_loc_pdr.dead_reckoning import ImuSample
from mine_loc_pdr.marked_motion import MarkedMotion, marked_motion

# After the marked end people go back as they like, and of those steps only some are marked.
AFTER_END_NS = 500 * NS_PER_MS
_START_NS = 10**15


def marked_walks(folder: Path) -> Iterator[tuple[str, MarkedMotion]]:
    """Who walked, and the motion with its strikes; raises ConfigurationError for what is not such a recording."""
    for name in recording_names(folder):
        path = folder / f"{name}.json"
        try:
            truth = json.loads(path.read_text("utf-8"))
            strikes = sorted(end for _, end in truth["LeftFootEvents"] + truth["RightFootEvents"])
            end_ns = int(truth["TrialBoundaries"][1]) * PERIOD_NS + AFTER_END_NS
            person = str(truth["Subject"])
        except (ValueError, KeyError, TypeError) as error:
            allowed = "Subject, TrialBoundaries, LeftFootEvents, RightFootEvents"
            raise ConfigurationError(f"{path}: {error!r}; allowed: {allowed}") from None
        table = read_samples(folder, name)
        stamps_ns = _START_NS + table.counter * PERIOD_NS
        rows = zip(stamps_ns.tolist(), table.rate_rad_s.tolist(), table.force_m_s2.tolist(), strict=True)
        samples = (ImuSample(stamp_ns, tuple(w), tuple(f)) for stamp_ns, w, f in rows)
        yield person, marked_motion(samples, np.array(strikes) * PERIOD_NS + _START_NS, end_ns + _START_NS)
