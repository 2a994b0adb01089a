"""Marked walks of which the step network is taught, of a folder like ipol_gait_lowerback."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from mine_loc_bringup.recordings.ipol import PERIOD_NS, names, read_trial
from mine_loc_core.stamps import NS_PER_MS
from mine_loc_pdr.dead_reckoning import ImuSample
from mine_loc_pdr.marked_motion import MarkedMotion, marked_motion

# After the marked end people go back as they like, and of those steps only some are marked.
AFTER_END_NS = 500 * NS_PER_MS


def marked_walks(folder: Path) -> Iterator[tuple[int, MarkedMotion]]:
    """Who walked, and the motion with its strikes; raises ConfigurationError for what is not such a recording."""
    for name in names(folder):
        trial = read_trial(folder, name)
        columns = (trial.samples.counter * PERIOD_NS, trial.samples.rate_rad_s, trial.samples.force_m_s2)
        rows = zip(*(column.tolist() for column in columns), strict=True)
        samples = (ImuSample(stamp_ns, tuple(rate), tuple(force)) for stamp_ns, rate, force in rows)
        strikes_ns = np.sort(np.concatenate([trial.left_strikes, trial.right_strikes])) * PERIOD_NS
        yield trial.subject, marked_motion(samples, strikes_ns, trial.end * PERIOD_NS + AFTER_END_NS)
