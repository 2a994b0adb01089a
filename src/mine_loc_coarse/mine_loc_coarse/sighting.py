"""One emitter as the reports of one window show it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Sighting:
    """`state` (4,) x, y, vx, vy [m, m/s] at the situation's instant, `covariance` (4, 4), who heard it last and when.

    `stated` says that the pairing is sure enough; `confidence` is the probability that the emitter exists, `emission`
    the number of its emission in the window.
    """

    emission: int
    frequency_hz: float
    state: NDArray[np.float64]
    covariance: NDArray[np.float64]
    confidence: float
    stated: bool
    monitors: tuple[int, ...]
    last_heard_ns: int
