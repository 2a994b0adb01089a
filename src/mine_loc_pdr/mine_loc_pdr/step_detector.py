"""Steps as a trained network sees them in the motion of the waist: the default; paper B's detector is in `steps.py`.

The network (`step_network.py`) gives every 20 ms the probability that a heel struck LOOKAHEAD_S ago. A step is a
maximum of it, stamped to a fraction of a frame by the parabola through three frames. How likely it must be the rhythm
says: within a walk the model's threshold is enough, unless the maximum comes earlier than the steps before it.
"""

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S, to_s
from mine_loc_pdr.step_frames import FRAME_NS, FrameStream
from mine_loc_pdr.step_kernel import Floats, StepStream
from mine_loc_pdr.steps import ADAPTATION, FIRST_INTERVAL_S, LONGEST_INTERVAL_NS, SLOWEST_STEP_S, Motion, Step

LOOKAHEAD_S = 0.3
SHORTEST_INTERVAL_NS = 280 * NS_PER_MS
_LOOKAHEAD_NS = round(LOOKAHEAD_S * NS_PER_S)
_SMOOTHING = np.convolve(np.full(6, 1.0 / 6.0), np.full(6, 1.0 / 6.0))  # two means of 120 ms
_FIRST_SWING_FRAMES = 30
_FIRST_PROBABILITY = 0.6  # of a step that begins a walk
_EARLY_POWER = 5.0  # by which the odds that a maximum needs grow with the usual interval over its own


@dataclass(frozen=True, slots=True, eq=False)
class StepModel:
    """Weights of the network, and the probability from which a maximum in the rhythm of the walk is a step."""

    weights: Floats
    threshold: float


class NetworkStepDetector:
    """Takes the motion of the waist sample by sample and reports steps 0.32 to 0.36 s after the strike.

    Stamps must increase.
    """

    def __init__(self, model: StepModel) -> None:
        self._rhythm_odds = _odds(model.threshold)
        self._frames = FrameStream()
        self._stream = StepStream(model.weights)
        self.reset()

    def reset(self) -> None:
        """Start afresh, after a gap in the data."""
        self._frames.reset()
        self._stream.reset()
        self._before = self._last = 0.0  # probabilities of the last two frames
        self._last_step_ns: int | None = None
        self._usual_interval_s = FIRST_INTERVAL_S
        self._vertical: deque[float] = deque(maxlen=LONGEST_INTERVAL_NS // FRAME_NS)
        self._since_step = 0  # frames

    def push(self, stamp_ns: int, motion: Motion) -> Step | None:
        """Take one sample; return the step it completes, if any."""
        frames = self._frames.push(stamp_ns, motion)
        step, end_ns = None, stamp_ns // FRAME_NS * FRAME_NS - len(frames) * FRAME_NS
        for frame in frames:
            end_ns += FRAME_NS
            self._vertical.append(float(frame[0]))
            self._since_step += 1
            logit = self._stream.push(frame)
            probability = 1.0 / (1.0 + math.exp(-logit)) if logit > -30.0 else 0.0
            step = self._at_maximum(end_ns, probability) or step
            self._before, self._last = self._last, probability
        return step

    def _at_maximum(self, end_ns: int, probability: float) -> Step | None:
        """The step that the frame before this one, which ends at end_ns, is the maximum of."""
        before, peak = self._before, self._last
        if peak < before or peak <= probability:
            return None
        offset = 0.5 * (before - probability) / (before - 2.0 * peak + probability)
        stamp_ns = end_ns - FRAME_NS - _LOOKAHEAD_NS - round(offset * FRAME_NS)
        return self._complete(stamp_ns, peak)

    def _complete(self, stamp_ns: int, probability: float) -> Step | None:
        since_ns = None if self._last_step_ns is None else stamp_ns - self._last_step_ns
        if since_ns is not None and since_ns < SHORTEST_INTERVAL_NS:
            return None
        interval_s = to_s(since_ns) if since_ns is not None and since_ns <= LONGEST_INTERVAL_NS else None
        if _odds(probability) < self._needed_odds(interval_s):
            return None
        swing_m_s2 = self._swing_m_s2(_FIRST_SWING_FRAMES if interval_s is None else self._since_step)
        self._keep_rhythm(interval_s)
        self._last_step_ns, self._since_step = stamp_ns, 0
        return Step(stamp_ns, interval_s, swing_m_s2, _confidence(probability))

    def _needed_odds(self, interval_s: float | None) -> float:
        """Of a maximum so long after the step before, None after standing."""
        if interval_s is None:
            return _odds(_FIRST_PROBABILITY)
        return self._rhythm_odds * math.pow(max(1.0, self._usual_interval_s / interval_s), _EARLY_POWER)

    def _keep_rhythm(self, interval_s: float | None) -> None:
        """Learn from the interval before a step, None after standing; a pause in it is no part of the rhythm."""
        if interval_s is None:
            self._usual_interval_s = FIRST_INTERVAL_S
        else:
            self._usual_interval_s += ADAPTATION * (min(interval_s, SLOWEST_STEP_S) - self._usual_interval_s)

    def _swing_m_s2(self, frames: int) -> float:
        """From valley to peak of the smoothed vertical acceleration in the last frames."""
        recent = np.fromiter(self._vertical, float)[-(frames + len(_SMOOTHING) - 1) :]
        return float(np.ptp(np.convolve(recent, _SMOOTHING, "valid" if len(recent) >= len(_SMOOTHING) else "same")))


def _odds(probability: float) -> float:
    return probability / (1.0 - probability) if probability < 1.0 else math.inf


def _confidence(probability: float) -> float:
    """How often a maximum of this probability is a step: logistic in its logit, of people left out of the training.

    The network is less sure than it could be: a strike's neighbours share its probability.
    """
    return 1.0 / (1.0 + math.exp(-1.2) * math.pow(1.0 / probability - 1.0, 2.1))
