"""Motion of the waist as frames: means over a fixed grid of 20 ms, whatever rate and jitter the samples come with.

A frame has the six channels of `Motion`.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from mine_loc_core.stamps import NS_PER_MS
from mine_loc_pdr.steps import Motion

Array = NDArray[np.float64]

FRAME_NS = 20 * NS_PER_MS
CHANNELS = 6
LONGEST_BRIDGED_NS = 600 * NS_PER_MS  # between samples: a step may be lost in it, a walk is not
MOST_FRAMES = LONGEST_BRIDGED_NS // FRAME_NS + 1  # that one sample can complete
_OFFSET_TIME_CONSTANT_S = 2.0  # of the mean that takes out what the accelerometer adds to gravity


class FrameStream:
    """Integrates the lines between samples over each frame. Stamps must increase, by LONGEST_BRIDGED_NS at most."""

    def __init__(self) -> None:
        self._state = np.zeros(2 * CHANNELS + 1)  # motion of the last sample, its integral over the frame, offset
        self._frames = np.zeros((MOST_FRAMES, CHANNELS))
        self._last_ns = -1
        self.push(0, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0))  # compiled before the first sample is waiting
        self.reset()

    def reset(self) -> None:
        """Start afresh, after a gap in the data."""
        self._state[:] = 0.0
        self._last_ns = -1

    def push(self, stamp_ns: int, motion: Motion) -> Array:
        """Take one sample; the frames (n, CHANNELS) it completes, which end at the last multiples of FRAME_NS by then.

        The array is valid up to the next call.
        """
        count = _integrate(self._state, self._frames, self._last_ns, stamp_ns, motion)
        self._last_ns = stamp_ns
        return self._frames[:count]


@njit(cache=True)
def _integrate(state: Array, frames: Array, last_ns: int, stamp_ns: int, motion: Motion) -> int:
    """Write the frames that end in (last_ns, stamp_ns]; how many."""
    up = motion[0]
    if last_ns < 0:
        for c in range(CHANNELS):  # the frame that has begun: as if it had been so from its start
            state[CHANNELS + c] = motion[c] * (stamp_ns % FRAME_NS)
    else:
        share = (stamp_ns - last_ns) * 1e-9 / _OFFSET_TIME_CONSTANT_S
        state[2 * CHANNELS] += (up - state[2 * CHANNELS]) * min(share, 1.0)
    count = 0
    if last_ns >= 0:
        from_ns = last_ns
        span_ns = float(stamp_ns - last_ns)
        while from_ns < stamp_ns:
            edge_ns = (from_ns // FRAME_NS + 1) * FRAME_NS
            to_ns = min(edge_ns, stamp_ns)
            middle = (0.5 * (from_ns + to_ns) - last_ns) / span_ns
            for c in range(CHANNELS):
                now = motion[c] - state[2 * CHANNELS] if c == 0 else motion[c]
                mean = state[c] + (now - state[c]) * middle
                state[CHANNELS + c] += mean * (to_ns - from_ns)
            if to_ns == edge_ns:
                for c in range(CHANNELS):
                    frames[count, c] = state[CHANNELS + c] / FRAME_NS
                    state[CHANNELS + c] = 0.0
                count += 1
            from_ns = to_ns
    for c in range(CHANNELS):
        state[c] = motion[c] - state[2 * CHANNELS] if c == 0 else motion[c]
    return count
