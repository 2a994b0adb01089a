"""Step detection on the vertical acceleration of the waist (paper B, section 2.2.1).

A causal moving median smooths the signal; a step is an adjacent peak and valley, both past their thresholds, with
exactly one zero crossing between them. A valley that reaches its threshold is past it whatever follows, so a step is
reported at that sample already: 0.24 s after the heel strike in the median, which keeps a live position live.
"""

import math
from bisect import bisect_left, insort
from collections import deque
from dataclasses import dataclass

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S, to_s

# The window and thresholds are those of least error on people 1 to 7 of ipol_gait_lowerback; people 8 to 13 are kept
# for scoring (test_dead_reckoning.py).
MEDIAN_WINDOW_NS = 75 * NS_PER_MS
PEAK_THRESHOLD_M_S2 = 0.4
VALLEY_THRESHOLD_M_S2 = 0.2
# Shifting one's weight while standing also makes a peak and a valley; most first peaks below this are no step.
START_PEAK_THRESHOLD_M_S2 = 1.0
SHORTEST_INTERVAL_NS = 300 * NS_PER_MS
LONGEST_INTERVAL_NS = 2 * NS_PER_S  # what comes later starts a new walk
_BASELINE_TIME_CONSTANT_S = 5.0


@dataclass(frozen=True, slots=True)
class Step:
    """One step: `stamp_ns` is the heel strike, `interval_s` the time since the step before, None after standing."""

    stamp_ns: int
    interval_s: float | None
    peak_m_s2: float

    @property
    def confidence(self) -> float:
        """Probability that this was a step: logistic in the peak, less for a first one; fitted on people 1 to 7."""
        logit = 0.26 + 1.42 * self.peak_m_s2 - (2.97 if self.interval_s is None else 0.0)
        return 1.0 / (1.0 + math.exp(-logit))


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


class StepDetector:
    """Takes the vertical acceleration sample by sample and reports steps as they are seen.

    Stamps must increase. An offset of the accelerometer is removed by a slow mean.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Start afresh, after a gap in the data."""
        self._median = MovingMedian(MEDIAN_WINDOW_NS)
        self._last_sample_ns: int | None = None
        self._baseline = 0.0
        self._positive = False
        self._peak_m_s2 = 0.0
        self._peak_ns = 0
        self._awaiting_valley = False
        self._last_step_ns: int | None = None

    def push(self, stamp_ns: int, vertical_m_s2: float) -> Step | None:
        """Take one sample, upwards positive and without gravity; return the step it completes, if any."""
        middle_ns, value = self._median.push(stamp_ns, self._without_offset(stamp_ns, vertical_m_s2))
        if value > 0.0:
            if not self._positive:
                self._positive, self._peak_m_s2 = True, 0.0
            if value > self._peak_m_s2:
                self._peak_m_s2, self._peak_ns = value, middle_ns
            return None
        if self._positive:
            self._positive, self._awaiting_valley = False, self._peak_m_s2 >= PEAK_THRESHOLD_M_S2
        if self._awaiting_valley and value <= -VALLEY_THRESHOLD_M_S2:
            self._awaiting_valley = False
            return self._step()
        return None

    def _without_offset(self, stamp_ns: int, value: float) -> float:
        if self._last_sample_ns is not None:
            dt_s = to_s(stamp_ns - self._last_sample_ns)
            self._baseline += (value - self._baseline) * min(dt_s / _BASELINE_TIME_CONSTANT_S, 1.0)
        self._last_sample_ns = stamp_ns
        return value - self._baseline

    def _step(self) -> Step | None:
        last_ns = self._last_step_ns
        if last_ns is None or self._peak_ns - last_ns > LONGEST_INTERVAL_NS:
            if self._peak_m_s2 < START_PEAK_THRESHOLD_M_S2:
                return None
            interval_s = None
        elif self._peak_ns - last_ns < SHORTEST_INTERVAL_NS:
            return None
        else:
            interval_s = to_s(self._peak_ns - last_ns)
        self._last_step_ns = self._peak_ns
        return Step(self._peak_ns, interval_s, self._peak_m_s2)
