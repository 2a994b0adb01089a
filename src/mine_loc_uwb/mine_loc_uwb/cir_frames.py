"""DW1000 receptions as arrays: what every reader of recordings and the live node hand to the LOS classifier."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

Reals = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class CirFrames:
    """`n` receptions whose accumulators are known over equally many taps; arrays (n,) unless stated.

    A value that is not known is NaN, an integer 0. Magnitudes without phase stand in the in-phase column.
    """

    samples: NDArray[np.int16]  # (n, taps, 2) = in phase, quadrature, counts
    start_index: NDArray[np.int64]  # index in the accumulator of the first tap
    first_path_index: Reals  # taps, absolute
    symbols: Reals  # RXPACC
    noise_std: Reals  # STD_NOISE, counts
    receive_power_dbm: Reals
    first_path_power_dbm: Reals
    range_m: Reals
    channel: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.samples)

    def take(self, which: NDArray[Any] | slice) -> "CirFrames":
        """Only some of the frames, by numbers, by mask or by slice."""
        return CirFrames(*(getattr(self, field.name)[which] for field in fields(self)))

    def without_range(self) -> "CirFrames":
        """The same frames as a user sees them who has no range."""
        columns = {field.name: getattr(self, field.name) for field in fields(self)}
        return CirFrames(**columns | {"range_m": np.full(len(self), np.nan)})


def concatenate(parts: Sequence[CirFrames]) -> CirFrames:
    """Frames of several sources, one after the other; windows must have one width."""
    return CirFrames(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(CirFrames)))
