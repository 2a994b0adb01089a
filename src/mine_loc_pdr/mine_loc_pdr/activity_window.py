"""The last four seconds of a walk in equal pieces of time, from which its activity is told (paper B, section 4.2).

Paper B aligns its samples in time and smooths them by means. Here bins of a fixed grid of time do both, whatever the
sample rate and jitter: of each the mean of the force's magnitude and of its square stay, and the heading at its edges.
The magnitude less gravity is the vertical acceleration to first order, however the sensor is worn.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_pdr.attitude import STANDARD_GRAVITY_M_S2, Vector3

BIN_NS = 200 * NS_PER_MS  # no step is shorter; a longer gap between samples would leave a bin empty
BINS = 20
WINDOW_NS = BINS * BIN_NS  # 4 s, paper B section 4.2
HOP_NS = NS_PER_S  # from one window to the next
CLOCK_JUMP_NS = NS_PER_S  # a step back by more is a new clock, not a late sample
LARGEST_M_S2 = 1000.0  # beyond the range of any such sensor


@dataclass(frozen=True, slots=True)
class ActivityWindow:
    """Four seconds of one person that end at `end_ns`."""

    end_ns: int
    heading_rad: NDArray[np.float64]  # (BINS + 1,) of the waist at the edges of the bins, unwrapped, 0 at the start
    vertical_m_s2: NDArray[np.float64]  # (BINS,) mean of the force's magnitude less gravity
    square_m2_s4: NDArray[np.float64]  # (BINS,) mean of its square

    @property
    def turn_rad(self) -> float:
        """Change of heading from start to end, counter-clockwise positive."""
        return float(self.heading_rad[-1])


@dataclass(frozen=True, slots=True)
class _Bin:
    """What is left of the samples of a bin; the heading is that at its end."""

    heading_rad: float
    vertical_m_s2: float
    square_m2_s4: float


class WindowStream:
    """Takes one person's samples and gives a window each `hop_ns` of time, a multiple of BIN_NS.

    It is reported with the first sample at or after its end. Samples out of order or beyond any sensor are dropped, as
    dead reckoning drops them. A gap longer than BIN_NS or a clock set back begins anew: for four seconds there is no
    window then.
    """

    def __init__(self, hop_ns: int = HOP_NS) -> None:
        self._hop_ns = hop_ns
        self._bins: deque[_Bin] = deque(maxlen=BINS)
        self._start_rad = 0.0  # heading where the first of the bins begins
        self._last_ns: int | None = None
        self._heading_rad = 0.0
        self._begin(0)

    def push(self, stamp_ns: int, heading_rad: float, force_m_s2: Vector3) -> ActivityWindow | None:
        """Take the waist's heading and the specific force of a sample; return the window that it ends, if any."""
        fx, fy, fz = force_m_s2
        vertical_m_s2 = math.sqrt(fx * fx + fy * fy + fz * fz) - STANDARD_GRAVITY_M_S2
        last_ns = self._last_ns
        dt_ns = BIN_NS + 1 if last_ns is None else stamp_ns - last_ns
        if -CLOCK_JUMP_NS <= dt_ns <= 0 or not vertical_m_s2 <= LARGEST_M_S2:
            return None
        window = None
        if last_ns is None or not 0 < dt_ns <= BIN_NS:
            self._restart(stamp_ns, heading_rad)
        else:
            turned_rad = math.remainder(heading_rad - self._heading_rad, math.tau)
            if stamp_ns >= self._end_ns:
                share = (self._end_ns - last_ns) / dt_ns
                window = self._close(self._heading_rad + share * turned_rad)
            self._heading_rad += turned_rad
        self._last_ns = stamp_ns
        self._count += 1
        self._sum += vertical_m_s2
        self._squares += vertical_m_s2 * vertical_m_s2
        return window

    def _restart(self, stamp_ns: int, heading_rad: float) -> None:
        """Wait for the next edge: the bin in which data begin is not whole."""
        self._bins.clear()
        self._heading_rad = heading_rad
        self._begin((stamp_ns // BIN_NS + 1) * BIN_NS)
        self._whole = False

    def _begin(self, end_ns: int) -> None:
        self._end_ns, self._whole = end_ns, True
        self._count, self._sum, self._squares = 0, 0.0, 0.0

    def _close(self, heading_rad: float) -> ActivityWindow | None:
        """End the bin, with the heading at its end."""
        if not self._whole:
            self._start_rad = heading_rad
        else:
            if len(self._bins) == BINS:
                self._start_rad = self._bins[0].heading_rad
            self._bins.append(_Bin(heading_rad, self._sum / self._count, self._squares / self._count))
        end_ns = self._end_ns
        self._begin(end_ns + BIN_NS)
        return self._window(end_ns) if len(self._bins) == BINS and end_ns % self._hop_ns == 0 else None

    def _window(self, end_ns: int) -> ActivityWindow:
        edges = np.array([self._start_rad, *(each.heading_rad for each in self._bins)])
        return ActivityWindow(
            end_ns,
            edges - edges[0],
            np.array([each.vertical_m_s2 for each in self._bins]),
            np.array([each.square_m2_s4 for each in self._bins]),
        )
