"""Step detection on the vertical acceleration of the waist (paper B, section 2.2.1), and what a step is.

A causal moving median takes out spikes and two moving means the knocks of the heel; a step is an adjacent peak and
valley, both past their thresholds, with exactly one zero crossing between them. The thresholds follow the person: they
are shares of the peaks of the walk so far. A valley that reaches its threshold is past it whatever follows, so a step
is reported at that sample already, and a slow one's before it.

The foot that is drawn up at a halt or in a turn on the spot makes a peak far below the others; one such weak peak is
let through after a full step, when it comes in time.
"""

import math
from bisect import bisect_left, insort
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeAlias

from mine_loc_core.stamps import NS_PER_MS, to_s

Motion: TypeAlias = tuple[float, float, float, float, float, float]
"""Acceleration without gravity (m/s²) upwards and along two level directions that turn with the waist, the second a
quarter turn left of the first; the turn rate (rad/s) about the vertical and about these two."""

MEDIAN_WINDOW_NS = 75 * NS_PER_MS
MEAN_WINDOW_NS = 120 * NS_PER_MS
SHORTEST_INTERVAL_NS = 300 * NS_PER_MS
LONGEST_INTERVAL_NS = 1500 * NS_PER_MS  # what comes later starts a new walk
SLOWEST_STEP_S = 0.75  # what takes longer holds a pause: of 0.6 to 1 s the best for lengths on ipol_gait_lowerback
# The heel strikes this long after the smoothed acceleration rises through zero: median over ipol_gait_lowerback.
STRIKE_AFTER_RISE_NS = 65 * NS_PER_MS
# Half waves of the slowest walk; what takes longer is no step, and would be reported late.
_LONGEST_PEAK_NS = 550 * NS_PER_MS
_LONGEST_WAIT_NS = 200 * NS_PER_MS  # from the zero crossing to the valley's threshold
# A slow peak that has lasted so long and is past is a step before its valley, which comes more than 0.4 s after the
# strike.
_OVERDUE_NS = 260 * NS_PER_MS
_OVERDUE_PEAK_SHARE = 0.5  # of the usual peak, at least
_OVERDUE_FALL_SHARE = 0.6  # of its own peak, at most
_BASELINE_TIME_CONSTANT_S = 2.0
ADAPTATION = 0.3  # share of the newest step in what is held for usual
FIRST_INTERVAL_S = 0.55  # until a walk has shown its own


@dataclass(frozen=True, slots=True)
class StepThresholds:
    """Of the smoothed vertical acceleration in m/s², chosen by leave-one-subject-out on ipol_gait_lowerback.

    `python bench/pdr.py --only ipol` repeats the choice of the three that matter most: `start_peak_m_s2`, `peak_share`
    and `weak_peak_m_s2`.
    """

    # Shifting one's weight while standing, and the push that begins a walk, also make a peak and a valley.
    start_peak_m_s2: float = 1.0
    peak_m_s2: float = 0.15
    peak_share: float = 0.2  # of the usual peak of this walk
    valley_m_s2: float = 0.05
    weak_peak_m_s2: float = 0.08
    weak_valley_m_s2: float = 0.01
    weak_interval: tuple[float, float] = (0.6, 1.6)  # of the usual interval


@dataclass(frozen=True, slots=True)
class Step:
    """One step: `stamp_ns` is the heel strike, `interval_s` the time since the step before, None after standing.

    `confidence` is the probability that this was a step.
    """

    stamp_ns: int
    interval_s: float | None
    confidence: float


class StepDetector(Protocol):
    """Takes the motion of one person's waist sample by sample and reports steps as they are seen."""

    def push(self, stamp_ns: int, motion: Motion) -> Sequence[Step]:
        """Take one sample, whose stamp is later than the last one's; return the steps it completes, in order."""

    def reset(self) -> None:
        """Start afresh, after a gap in the data."""


class MovingMedian:
    """Median of the samples of the last `window_ns`, in one insertion and one removal a sample."""

    def __init__(self, window_ns: int) -> None:
        self._window_ns = window_ns
        self._samples: deque[tuple[int, float]] = deque()
        self._sorted: list[float] = []

    def push(self, stamp_ns: int, value: float) -> tuple[int, float]:
        """The middle instant of the window and the median in it."""
        samples, ordered = self._samples, self._sorted
        samples.append((stamp_ns, value))
        insort(ordered, value)
        while samples[0][0] <= stamp_ns - self._window_ns:
            del ordered[bisect_left(ordered, samples.popleft()[1])]
        return (samples[0][0] + stamp_ns) // 2, ordered[len(ordered) // 2]


class MovingMean:
    """Mean of the samples of the last `window_ns`."""

    def __init__(self, window_ns: int) -> None:
        self._window_ns = window_ns
        self._samples: deque[tuple[int, float]] = deque()
        self._sum = 0.0

    def push(self, stamp_ns: int, value: float) -> tuple[int, float]:
        """The middle instant of the window and the mean in it."""
        samples = self._samples
        samples.append((stamp_ns, value))
        self._sum += value
        while samples[0][0] <= stamp_ns - self._window_ns:
            self._sum -= samples.popleft()[1]
        return (samples[0][0] + stamp_ns) // 2, self._sum / len(samples)


class PeakStepDetector:
    """Paper B's detector, which needs no gyro: of the motion it takes the vertical acceleration alone.

    An offset of the accelerometer is removed by a slow mean.
    """

    def __init__(self, thresholds: StepThresholds | None = None) -> None:
        self._thresholds = thresholds or StepThresholds()
        self.reset()

    def reset(self) -> None:
        """Start afresh, after a gap in the data."""
        self._filters = (MovingMedian(MEDIAN_WINDOW_NS), MovingMean(MEAN_WINDOW_NS), MovingMean(MEAN_WINDOW_NS))
        self._last_sample_ns: int | None = None
        self._baseline = 0.0
        self._positive = False
        self._peak_m_s2 = 0.0
        self._rise_ns = self._fall_ns = 0
        self._awaiting_valley = self._foreseen = False
        self._last_step_ns: int | None = None
        self._was_weak = False
        self._usual_peak_m_s2 = 0.0
        self._usual_interval_s = FIRST_INTERVAL_S

    def push(self, stamp_ns: int, motion: Motion) -> Sequence[Step]:
        """See StepDetector."""
        step = self._completed_by(stamp_ns, motion[0])
        return () if step is None else (step,)

    def _completed_by(self, stamp_ns: int, up_m_s2: float) -> Step | None:
        middle_ns, value = stamp_ns, self._without_offset(stamp_ns, up_m_s2)
        for smooth in self._filters:
            middle_ns, value = smooth.push(middle_ns, value)
        if value > 0.0:
            if not self._positive:
                self._positive, self._peak_m_s2, self._rise_ns = True, 0.0, middle_ns
                self._foreseen = False
            self._peak_m_s2 = max(self._peak_m_s2, value)
            return self._overdue(middle_ns, value)
        if self._positive:
            self._positive, self._fall_ns = False, middle_ns
            self._awaiting_valley = not self._foreseen and middle_ns - self._rise_ns <= _LONGEST_PEAK_NS
        return self._at_valley(middle_ns, value) if self._awaiting_valley else None

    def _overdue(self, middle_ns: int, value: float) -> Step | None:
        """The step of a slow peak that is past, in a walk: its valley would come too late to be waited for."""
        last_ns, peak_m_s2 = self._last_step_ns, self._peak_m_s2
        lasts = middle_ns - self._rise_ns >= _OVERDUE_NS and value <= _OVERDUE_FALL_SHARE * peak_m_s2
        if self._foreseen or not lasts or last_ns is None:
            return None
        walking = self._rise_ns + STRIKE_AFTER_RISE_NS - last_ns <= LONGEST_INTERVAL_NS
        least_m_s2 = max(_OVERDUE_PEAK_SHARE * self._usual_peak_m_s2, self._thresholds.start_peak_m_s2)
        if not walking or peak_m_s2 < least_m_s2:
            return None
        self._foreseen = True
        return self._complete(strong=True)

    def _without_offset(self, stamp_ns: int, value: float) -> float:
        if self._last_sample_ns is not None:
            dt_s = to_s(stamp_ns - self._last_sample_ns)
            self._baseline += (value - self._baseline) * min(dt_s / _BASELINE_TIME_CONSTANT_S, 1.0)
        self._last_sample_ns = stamp_ns
        return value - self._baseline

    def _at_valley(self, middle_ns: int, value: float) -> Step | None:
        least = self._thresholds
        strong = self._peak_m_s2 >= max(least.peak_m_s2, least.peak_share * self._usual_peak_m_s2)
        if value > -(least.valley_m_s2 if strong else least.weak_valley_m_s2):
            self._awaiting_valley = middle_ns - self._fall_ns <= _LONGEST_WAIT_NS
            return None
        self._awaiting_valley = False
        return self._complete(strong=strong)

    def _complete(self, *, strong: bool) -> Step | None:
        least = self._thresholds
        stamp_ns, last_ns = self._rise_ns + STRIKE_AFTER_RISE_NS, self._last_step_ns
        if last_ns is None or stamp_ns - last_ns > LONGEST_INTERVAL_NS:
            return self._first(stamp_ns) if self._peak_m_s2 >= least.start_peak_m_s2 else None
        interval_s = to_s(stamp_ns - last_ns)
        if stamp_ns - last_ns < SHORTEST_INTERVAL_NS or not (strong or self._drawn_up(interval_s)):
            return None
        self._was_weak = not strong
        if strong:
            self._usual_peak_m_s2 += ADAPTATION * (self._peak_m_s2 - self._usual_peak_m_s2)
            self._usual_interval_s += ADAPTATION * (interval_s - self._usual_interval_s)
        return self._step(stamp_ns, interval_s)

    def _drawn_up(self, interval_s: float) -> bool:
        """Whether a weak peak, so long after a step, may be the other foot drawn up to it."""
        shortest, longest = self._thresholds.weak_interval
        in_time = shortest <= interval_s / self._usual_interval_s <= longest
        return in_time and not self._was_weak and self._peak_m_s2 >= self._thresholds.weak_peak_m_s2

    def _first(self, stamp_ns: int) -> Step:
        self._was_weak, self._usual_peak_m_s2, self._usual_interval_s = False, self._peak_m_s2, FIRST_INTERVAL_S
        return self._step(stamp_ns, None)

    def _step(self, stamp_ns: int, interval_s: float | None) -> Step:
        self._last_step_ns = stamp_ns
        return Step(stamp_ns, interval_s, _confidence(self._peak_m_s2))


def _confidence(peak_m_s2: float) -> float:
    """Logistic in the peak, fitted on people 1 to 7 of ipol_gait_lowerback."""
    return 1.0 / (1.0 + math.exp(0.7 - 2.8 * peak_m_s2))
