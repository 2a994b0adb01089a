"""Steps as a trained network sees them in the motion of the waist: the default; paper B's detector is in `steps.py`.

The network (`step_network.py`) gives every 20 ms the probability that a heel struck LOOKAHEAD_S ago. A step is a
maximum of it, stamped to a fraction of a frame by the parabola through three frames. How likely it must be the rhythm
says: within a walk the model's threshold is enough, unless the maximum comes earlier than the steps before it. After
standing one that is likely begins a walk at once; one that is in doubt waits for the next, and the two may bear each
other out.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S, to_s
from mine_loc_pdr.step_frames import FRAME_NS, FrameStream
from mine_loc_pdr.step_kernel import Floats, StepStream
from mine_loc_pdr.steps import ADAPTATION, FIRST_INTERVAL_S, LONGEST_INTERVAL_NS, SLOWEST_STEP_S, Motion, Step

LOOKAHEAD_S = 0.3
SHORTEST_INTERVAL_NS = 280 * NS_PER_MS
_LOOKAHEAD_NS = round(LOOKAHEAD_S * NS_PER_S)
_FIRST_ODDS = 1.5  # of a step that begins a walk alone
_PAIR_ODDS = 2.0  # product of those of two that begin a walk together
_LONGEST_PAIR_NS = NS_PER_S  # from one of them to the other
_EARLY_POWER = 5.0  # by which the odds that a maximum needs grow with the usual interval over its own


@dataclass(frozen=True, slots=True, eq=False)
class StepModel:
    """Weights of the network, and the probability from which a maximum in the rhythm of the walk is a step."""

    weights: Floats
    threshold: float


class NetworkStepDetector:
    """Takes the motion of the waist sample by sample and reports steps 0.32 to 0.36 s after the strike.

    A first step that was in doubt is reported with the second, 1.36 s after its strike at the latest. Stamps must
    increase.
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
        self._doubted: tuple[Step, float] | None = None  # that may begin a walk, and its odds

    def push(self, stamp_ns: int, motion: Motion) -> Sequence[Step]:
        """See StepDetector."""
        frames = self._frames.push(stamp_ns, motion)
        steps: list[Step] = []
        end_ns = stamp_ns // FRAME_NS * FRAME_NS - len(frames) * FRAME_NS
        for frame in frames:
            end_ns += FRAME_NS
            logit = self._stream.push(frame)
            probability = 1.0 / (1.0 + math.exp(-logit)) if logit > -30.0 else 0.0
            steps += self._at_maximum(end_ns, probability)
            self._before, self._last = self._last, probability
        return steps

    def _at_maximum(self, end_ns: int, probability: float) -> Sequence[Step]:
        """The steps that the frame before this one, which ends at end_ns, completes as a maximum."""
        before, peak = self._before, self._last
        if peak < before or peak <= probability:
            return ()
        offset = 0.5 * (before - probability) / (before - 2.0 * peak + probability)
        return self._complete(end_ns - FRAME_NS - _LOOKAHEAD_NS - round(offset * FRAME_NS), peak)

    def _complete(self, stamp_ns: int, probability: float) -> Sequence[Step]:
        last_ns, odds = self._last_step_ns, _odds(probability)
        if odds < self._rhythm_odds or (last_ns is not None and stamp_ns - last_ns < SHORTEST_INTERVAL_NS):
            return ()
        if last_ns is None or stamp_ns - last_ns > LONGEST_INTERVAL_NS:
            return self._begin(stamp_ns, probability)
        interval_s = to_s(stamp_ns - last_ns)
        if odds < self._rhythm_odds * self._hurry(interval_s):
            return ()
        return (self._walk_on(stamp_ns, interval_s, probability),)

    def _begin(self, stamp_ns: int, probability: float) -> Sequence[Step]:
        """The first step after standing; or the first two, where the second bears out one that was in doubt."""
        self._usual_interval_s = FIRST_INTERVAL_S
        odds, doubted = _odds(probability), self._doubted
        since_ns = LONGEST_INTERVAL_NS if doubted is None else stamp_ns - doubted[0].stamp_ns
        if doubted is not None and SHORTEST_INTERVAL_NS <= since_ns <= _LONGEST_PAIR_NS:
            first, first_odds = doubted
            if first_odds * odds >= _PAIR_ODDS * self._hurry(to_s(since_ns)):
                return first, self._walk_on(stamp_ns, to_s(since_ns), probability)
        if odds >= _FIRST_ODDS:
            return (self._walk_on(stamp_ns, None, probability),)
        if doubted is None or since_ns >= SHORTEST_INTERVAL_NS or odds > doubted[1]:
            self._doubted = Step(stamp_ns, None, _confidence(probability)), odds
        return ()

    def _hurry(self, interval_s: float) -> float:
        """By how much the odds must be better of a maximum that comes so early after the step before."""
        return math.pow(max(1.0, self._usual_interval_s / interval_s), _EARLY_POWER)

    def _walk_on(self, stamp_ns: int, interval_s: float | None, probability: float) -> Step:
        """Take a step; from its interval the rhythm is learnt, of which a pause in it is no part."""
        if interval_s is not None:
            self._usual_interval_s += ADAPTATION * (min(interval_s, SLOWEST_STEP_S) - self._usual_interval_s)
        self._last_step_ns, self._doubted = stamp_ns, None
        return Step(stamp_ns, interval_s, _confidence(probability))


def _odds(probability: float) -> float:
    return probability / (1.0 - probability) if probability < 1.0 else math.inf


def _confidence(probability: float) -> float:
    """How often a maximum of this probability is a step: logistic in its logit, of people left out of the training.

    The network is less sure than it could be: a strike's neighbours share its probability.
    """
    return 1.0 / (1.0 + math.exp(-1.2) * math.pow(1.0 / probability - 1.0, 2.1))
