"""What a position solver is given: all that one tag measured at one instant."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Measurements:
    """One ranging round or one blink of one tag, checked and corrected; arrays are of shape (n,), one entry a link.

    `range_m` are slant ranges, finite and positive. With `shared_offset` they are the arrivals of one blink as ways
    that share an unknown offset (the reference anchor's is 0), so that a time difference is the difference of two of
    them; they may then be negative.
    """

    stamp_ns: int
    anchor_ids: npt.NDArray[np.uint64]
    anchors_m: Array
    """Positions, shape (n, 3), in the frame of the anchors."""
    range_m: Array
    variance_m2: Array
    """Of white noise, positive."""
    since_s: Array
    """Instant of each exchange minus `stamp_ns` [s]."""
    los_probability: Array
    """NaN = not judged."""
    receive_power_dbm: Array
    """True levels (`received_power.uncompress_dbm`), NaN = not reported."""
    height_m: float | None = None
    """Known height of the tag; None = solve in space."""
    shared_offset: bool = False

    def __len__(self) -> int:
        return len(self.range_m)

    @property
    def dimensions(self) -> int:
        """How many coordinates are to be solved."""
        return 3 if self.height_m is None else 2

    @property
    def plane_m(self) -> float:
        """`height_m` as compiled code takes it: NaN = solve in space."""
        return math.nan if self.height_m is None else self.height_m
