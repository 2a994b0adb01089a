"""Windows of a walk as the node `pdr` would have them: samples through dead reckoning."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mine_loc_pdr.activity_window import BIN_NS, ActivityWindow, WindowStream
from mine_loc_pdr.dead_reckoning import ImuSample, PedestrianDeadReckoning
from mine_loc_pdr.stride import PendulumStrideModel

_HEIGHT_M = 1.75  # whatever: the length of steps is not used


def windows_of(
    stamps_ns: NDArray[np.int64], rate_rad_s: NDArray[np.float64], force_m_s2: NDArray[np.float64]
) -> Iterator[ActivityWindow]:
    """A window at every edge of a bin, of samples (n,), (n, 3) and (n, 3) in forward-left-up axes."""
    pdr, stream = PedestrianDeadReckoning(PendulumStrideModel(_HEIGHT_M)), WindowStream(BIN_NS)
    for stamp_ns, rate, force in zip(stamps_ns.tolist(), rate_rad_s.tolist(), force_m_s2.tolist(), strict=True):
        pdr.push(ImuSample(stamp_ns, tuple(rate), tuple(force)))
        if pdr.heading_rad is not None:
            window = stream.push(stamp_ns, pdr.heading_rad, tuple(force))
            if window is not None:
                yield window
