"""The last second of each link: one frame's powers waver by half a decibel, their median over ten frames does not."""

from collections import OrderedDict, deque
from collections.abc import Hashable, Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float32]
DEPTH = 10
"""Frames of a link that count; a second at 10 Hz, in which a walker goes a little more than a metre."""
_MEMORY_NS = 2_000_000_000
_MOST_LINKS = 4096


class LinkHistory:
    """Side features of the latest frames of every link; links heard longest ago are forgotten first."""

    def __init__(self) -> None:
        self._links: OrderedDict[Hashable, deque[tuple[int, Floats]]] = OrderedDict()

    def extend(self, link: Hashable, stamp_ns: int, side: Floats) -> Floats:
        """Add a frame's features (f,); returns them and their medians over the link's last frames, (2 f,).

        A frame that is older than the link's newest, or two seconds younger, begins the history anew. What is NaN
        in all frames stays NaN.
        """
        frames = self._links.setdefault(link, deque(maxlen=DEPTH))
        self._links.move_to_end(link)
        if len(self._links) > _MOST_LINKS:
            self._links.popitem(last=False)
        if frames and not 0 <= stamp_ns - frames[-1][0] <= _MEMORY_NS:
            frames.clear()
        frames.append((stamp_ns, side))
        return np.concatenate([side, _median(np.stack([each for _, each in frames]))])


def with_history(links: Sequence[Hashable], stamp_ns: Sequence[int], side: Floats) -> Floats:
    """Features (n, f) of frames in order of time as the live node would have them, (n, 2 f)."""
    history = LinkHistory()
    rows = [history.extend(*row) for row in zip(links, stamp_ns, side, strict=True)]
    return np.array(rows, np.float32).reshape(len(side), 2 * side.shape[1])


@njit(cache=True)
def _median(rows: Floats) -> Floats:
    """Median of each column (k, f) over what is not NaN; NaN where nothing is left."""
    found = np.empty(rows.shape[1], np.float32)
    for column in range(rows.shape[1]):
        found[column] = np.nanmedian(rows[:, column])
    return found
