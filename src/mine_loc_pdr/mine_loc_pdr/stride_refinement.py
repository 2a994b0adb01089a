"""The scale K of a person's steps, refined on the way from stretches on which UWB positions are good.

Over a stretch the dead-reckoned way and the UWB way are the same but for a turn, a shift and a factor; that factor, by
least squares (Umeyama, "Least-squares estimation of transformation parameters between two point patterns", IEEE PAMI
13(4), 1991, in the plane), is what K is wrong by.
"""

import math
from collections import Counter, deque
from dataclasses import dataclass

import numpy as np

from mine_loc_core.stamps import NS_PER_S
from mine_loc_pdr.stride_calibration import WALK_TO_WALK_SD

LEAST_WAY_M = 12.0
LARGEST_SD_M = 0.3  # of a position on an axis
LONGEST_SILENCE_NS = NS_PER_S
LARGEST_RESIDUAL_M = 0.5
GATE_SD = 3.0
SCALE_WALK_SD = 0.005  # assumed: how K changes from one stretch to the next, with load, slope and fatigue
_FEWEST_PAIRS = 10
_MOST_PAIRS = 1000
_MOST_FIXES = 200  # that wait for the step after them


@dataclass(frozen=True, slots=True)
class Fix:
    """A UWB position in the map in m, as x + iy, and the larger of its variances in m²."""

    stamp_ns: int
    position_m: complex
    variance_m2: float


@dataclass(frozen=True, slots=True)
class StrideScale:
    """K, its variance, and the steps it was refined on."""

    scale: float
    variance: float
    steps_used: int


class StrideRefiner:
    """Pairs fixes with dead reckoning. `verdicts` counts stretches by what came of them."""

    def __init__(self, scale: float, variance: float) -> None:
        """K that the dead-reckoned steps are made with, until `step` returns another."""
        self.known = StrideScale(scale, variance, 0)
        self.verdicts: Counter[str] = Counter()
        self._fixes: deque[Fix] = deque(maxlen=_MOST_FIXES)
        self._before: tuple[int, complex] | None = None
        self._restart()

    def fix(self, fix: Fix) -> None:
        """Take a position; it waits for the steps around it, which are known later."""
        self._fixes.append(fix)

    def step(self, stamp_ns: int, position_m: complex, *, first: bool) -> StrideScale | None:
        """Take the dead-reckoned position after a step, `first` after standing; K anew if that ended a good stretch.

        The caller then makes steps with this K.
        """
        before, self._before = self._before, (stamp_ns, position_m)
        if first or before is None:
            self._restart()
            return None
        self._steps += 1
        begin_ns, begin_m = before
        while self._fixes and self._fixes[0].stamp_ns <= stamp_ns:
            fix = self._fixes.popleft()
            if fix.stamp_ns > begin_ns:
                share = (fix.stamp_ns - begin_ns) / (stamp_ns - begin_ns)
                self._pair(fix, begin_m + share * (position_m - begin_m))
        return self._refined() if self._way_m() >= LEAST_WAY_M else None

    def _restart(self) -> None:
        self._pairs: list[tuple[complex, complex]] = []  # dead reckoned, UWB
        self._last_ns = self._steps = 0
        self._variance_m2 = 0.0

    def _pair(self, fix: Fix, reckoned_m: complex) -> None:
        if self._pairs and fix.stamp_ns - self._last_ns > LONGEST_SILENCE_NS:
            self._restart()
        if not fix.variance_m2 <= LARGEST_SD_M**2:
            self._restart()
            return
        if len(self._pairs) == _MOST_PAIRS:  # who walks to and fro makes pairs but no way
            self._restart()
        self._pairs.append((reckoned_m, fix.position_m))
        self._last_ns = fix.stamp_ns
        self._variance_m2 = max(self._variance_m2, fix.variance_m2)

    def _way_m(self) -> float:
        """As the crow flies."""
        return abs(self._pairs[-1][0] - self._pairs[0][0]) if self._pairs else 0.0

    def _refined(self) -> StrideScale | None:
        reckoned, measured = np.array(self._pairs).T
        way_m, steps, stated_m2 = self._way_m(), self._steps, self._variance_m2
        self._restart()
        reckoned, measured = reckoned - reckoned.mean(), measured - measured.mean()
        turn = np.vdot(reckoned, measured) / np.vdot(reckoned, reckoned).real
        residual_m2 = float(np.mean(np.abs(measured - turn * reckoned) ** 2))
        if len(reckoned) < _FEWEST_PAIRS or residual_m2 > LARGEST_RESIDUAL_M**2:
            self.verdicts["too_few" if len(reckoned) < _FEWEST_PAIRS else "unlike"] += 1
            return None
        # Errors of UWB last for metres, so no more than the two ends of a stretch are held for independent.
        own = (2.0 * max(stated_m2, residual_m2) / way_m**2 + WALK_TO_WALK_SD**2) * self.known.scale**2
        return self._taken(float(abs(turn)) * self.known.scale, own, steps)

    def _taken(self, scale: float, own_variance: float, steps: int) -> StrideScale | None:
        known = self.known
        variance = known.variance + (SCALE_WALK_SD * known.scale) ** 2
        if abs(scale - known.scale) > GATE_SD * math.sqrt(variance + own_variance):
            self.verdicts["beyond_gate"] += 1
            return None
        self.verdicts["used"] += 1
        gain = variance / (variance + own_variance)
        refined = known.scale + gain * (scale - known.scale)
        self.known = StrideScale(refined, (1.0 - gain) * variance, known.steps_used + steps)
        return self.known
