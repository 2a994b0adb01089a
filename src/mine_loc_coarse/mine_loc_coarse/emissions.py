"""Which reports are of one emission by their frequency (paper E, step 3: "same frequency")."""

import numpy as np
from numpy.typing import NDArray

from mine_loc_coarse.open_reports import Reports

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


def emissions(reports: Reports, accuracy_hz: float) -> Indices:
    """Number of the emission of each report, (n,), in order of frequency.

    Reports are of one emission when both ends of their band agree within twice the accuracy, so hopping emitters are
    told apart by the band they hop over. No channel plan is needed: channels are wider apart than monitors err.
    """
    by_middle = _runs(reports.middle_hz, 2.0 * accuracy_hz)
    # Widths err by the accuracy of both ends; within one middle they are compared on a scale of their own.
    spread = np.ptp(reports.width_hz) + 1.0 if len(reports) else 1.0
    step = spread + 8.0 * accuracy_hz
    return _runs(by_middle * step + reports.width_hz, 4.0 * accuracy_hz)


def _runs(values: Array, gap: float) -> Indices:
    """Number of the run that each value is in, runs being apart by more than `gap`."""
    order = np.argsort(values, kind="stable")
    jumps = np.diff(values[order], prepend=values[order[:1]]) > gap
    numbers = np.empty(len(values), np.int64)
    numbers[order] = np.cumsum(jumps)
    return numbers
