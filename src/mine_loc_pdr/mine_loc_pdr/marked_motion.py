"""Walks whose heel strikes are marked, as the frames of motion that the step detector would have had of them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.stamps import NS_PER_S
from mine_loc_pdr.dead_reckoning import ImuSample, PedestrianDeadReckoning
from mine_loc_pdr.step_frames import FRAME_NS, FrameStream
from mine_loc_pdr.steps import Motion, Step
from mine_loc_pdr.stride import TYPICAL_HEIGHT_M, PendulumStrideModel

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class MarkedMotion:
    """Frames (n, CHANNELS) of a walk, its strikes and until when they are marked (s from the first frame's end)."""

    frames: Array
    strikes_s: Array
    end_s: float


def marked_motion(samples: Iterable[ImuSample], strikes_ns: Array, end_ns: float) -> MarkedMotion:
    """The motion of a recording; frames that were lost in a gap lie on the line between their neighbours.

    Raises ValueError for one too short to find the horizon in.
    """
    recorder = _Recorder()
    pdr = PedestrianDeadReckoning(PendulumStrideModel(TYPICAL_HEIGHT_M), detector=recorder)
    for sample in samples:
        pdr.push(sample)
    if not recorder.ends_ns:
        raise ValueError("no frame of motion; allowed: a recording of a second or more")
    ends_ns = np.array(recorder.ends_ns)
    grid_ns = np.arange(ends_ns[0], ends_ns[-1] + 1, FRAME_NS)
    frames = np.column_stack([np.interp(grid_ns, ends_ns, column) for column in np.array(recorder.frames).T])
    return MarkedMotion(frames, (strikes_ns - ends_ns[0]) / NS_PER_S, float(end_ns - ends_ns[0]) / NS_PER_S)


class _Recorder:
    """A step detector that finds no step but keeps what it is told."""

    def __init__(self) -> None:
        self._stream = FrameStream()
        self.ends_ns: list[int] = []
        self.frames: list[Array] = []

    def push(self, stamp_ns: int, motion: Motion) -> Sequence[Step]:
        frames = self._stream.push(stamp_ns, motion)
        last_ns = stamp_ns // FRAME_NS * FRAME_NS
        self.ends_ns += range(last_ns - (len(frames) - 1) * FRAME_NS, last_ns + 1, FRAME_NS)
        self.frames += [frame.copy() for frame in frames]
        return ()

    def reset(self) -> None:
        self._stream.reset()
