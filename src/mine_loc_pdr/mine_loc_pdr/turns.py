"""Turns of a walking person, from where the waist faces, as soon as they are over.

Paper B recognises turns in windows of 4 s by a support vector machine (its section 3.2). For live use this looks at the
heading alone: the waist sways with the stride, so the heading is averaged over about one stride, which lets a turn
through and the sway not; then a turn is a stretch in which that average keeps turning one way.
"""

import math
from collections import deque
from dataclasses import dataclass

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S, to_s

PERIOD_NS = 50 * NS_PER_MS  # headings are looked at so often; a turn lasts a second
STRIDE_NS = 1_100 * NS_PER_MS  # two steps at 1.8 Hz
RATE_SPAN_NS = 300 * NS_PER_MS  # over which the rate of the average is taken
LONGEST_GAP_NS = 200 * NS_PER_MS
# Of the averaged heading. A curved gallery of 10 m radius turns a walker by 7 °/s, a corner by 40 °/s and more.
BEGIN_RATE_RAD_S = math.radians(20.0)
END_RATE_RAD_S = math.radians(15.0)
LEAST_ANGLE_RAD = math.radians(25.0)  # below it a stride's own unrest may be the cause
LONGEST_TURN_NS = 6 * NS_PER_S  # beyond it a person walks in a circle
# Assumed: of the mean facing over a stride against the course walked, each of before and after the turn.
FACING_SD_RAD = math.radians(5.0)
SCALE_SD = 0.01  # of the angle, by the gyro's scale


@dataclass(frozen=True, slots=True)
class Turn:
    """A turn: when it began, was half done and ended, its angle, counter-clockwise positive, and the heading before."""

    begin_ns: int
    middle_ns: int
    end_ns: int
    before_rad: float
    angle_rad: float
    angle_variance_rad2: float


class TurnDetector:
    """Finds turns in a stream of headings; each is reported about 1.2 s after nine tenths of it.

    `faults` counts headings that were dropped: not_finite, duplicate or backward. A gap of more than 0.2 s ends what
    was going on: an angle turned unseen is not known.
    """

    def __init__(self) -> None:
        self.faults: dict[str, int] = {"not_finite": 0, "duplicate": 0, "backward": 0}
        self._last_ns: int | None = None
        self.reset()

    def reset(self) -> None:
        """Forget the headings so far."""
        self._headings: deque[tuple[int, float]] = deque()
        self._sum_rad = 0.0
        self._averages: deque[tuple[int, float]] = deque()
        self._turning: list[tuple[int, float]] = []

    def push(self, stamp_ns: int, heading_rad: float) -> Turn | None:
        """Take the heading of the waist at stamp_ns, in any range of 2π; return the turn that is over with it."""
        if not math.isfinite(heading_rad):
            self.faults["not_finite"] += 1
            return None
        last_ns = self._last_ns
        if last_ns is not None and 0 < stamp_ns - last_ns < PERIOD_NS:
            return None
        if last_ns is not None and -NS_PER_S <= stamp_ns - last_ns <= 0:
            self.faults["backward" if stamp_ns < last_ns else "duplicate"] += 1
            return None
        if last_ns is not None and not 0 < stamp_ns - last_ns <= LONGEST_GAP_NS:
            self.reset()
        self._last_ns = stamp_ns
        average = self._average(stamp_ns, heading_rad)
        return None if average is None else self._follow(average)

    def _average(self, stamp_ns: int, heading_rad: float) -> tuple[int, float] | None:
        """The mean heading over the stride that ends here, stamped with its middle; None before there is one."""
        headings = self._headings
        before_rad = headings[-1][1] if headings else 0.0
        heading_rad = before_rad + math.remainder(heading_rad - before_rad, math.tau)
        headings.append((stamp_ns, heading_rad))
        self._sum_rad += heading_rad
        full = False
        while headings[0][0] <= stamp_ns - STRIDE_NS:
            self._sum_rad -= headings.popleft()[1]
            full = True
        if not full and not self._averages:
            return None
        return (headings[0][0] + stamp_ns) // 2, self._sum_rad / len(headings)

    def _follow(self, average: tuple[int, float]) -> Turn | None:
        averages, turning = self._averages, self._turning
        averages.append(average)
        while averages[0][0] < average[0] - RATE_SPAN_NS:
            averages.popleft()
        before = averages[0]
        if average[0] - before[0] < RATE_SPAN_NS // 2:
            return None
        rate_rad_s = (average[1] - before[1]) / to_s(average[0] - before[0])
        if not turning:
            if abs(rate_rad_s) >= BEGIN_RATE_RAD_S:
                self._turning = [*averages]
            return None
        direction = math.copysign(1.0, turning[-1][1] - turning[0][1])
        too_long = average[0] - turning[0][0] > LONGEST_TURN_NS
        if not too_long:
            turning.append(average)
        if direction * rate_rad_s >= END_RATE_RAD_S:
            return None
        self._turning = []
        return None if too_long else _turn(turning)


def _turn(averages: list[tuple[int, float]]) -> Turn | None:
    """The turn made by the averaged headings; None if it is too small for one."""
    angle_rad = averages[-1][1] - averages[0][1]
    if abs(angle_rad) < LEAST_ANGLE_RAD:
        return None
    share = [(stamp_ns, (heading - averages[0][1]) / angle_rad) for stamp_ns, heading in averages]
    begin_ns, middle_ns, end_ns = (next(stamp for stamp, done in share if done >= part) for part in (0.1, 0.5, 0.9))
    variance = 2.0 * FACING_SD_RAD**2 + (SCALE_SD * angle_rad) ** 2
    return Turn(begin_ns, middle_ns, end_ns, averages[0][1], angle_rad, variance)
