"""Measurements as broken software sends them: any number where a number goes."""

import math

import numpy as np
from walks import HALL, HEIGHT_M, T0

from mine_loc_core.site import Anchor
from mine_loc_core.stamps import NS_PER_MS
from mine_loc_core.verdicts import Source
from mine_loc_fusion.estimate import EpochInputs, PlaceFix, PositionFix, StepFix, VelocityChange
from mine_loc_uwb.range_intake import MeasuredRange, RangeIntake

_ODD = (0.0, -0.0, math.nan, math.inf, -math.inf, 1e300, -1e300, 1e30, 1e7, -1e7, 1e-300, 1e-30, 1e-9, 5e-324)


class Garbage:
    """Epochs from seeded chance, one after another, up to a minute apart; most numbers are ordinary."""

    def __init__(self, seed, *, space=False, start_ns=T0):
        self.rng, self.stamp_ns = np.random.default_rng(seed), start_ns
        self._odd_share = self.rng.choice([0.0, 0.02, 0.3])
        self._height_m = None if space else HEIGHT_M
        anchors = [Anchor(i, str(i), tuple(place), 0.0, 0.0) for i, place in enumerate(HALL.tolist(), 1)]
        self._intake = RangeIntake(anchors, 300.0)

    def number(self, usual=1.0):
        if self.rng.random() < self._odd_share:
            return float(self.rng.choice(_ODD))
        return float(self.rng.normal(0.0, usual))

    def positive(self, usual=1.0):
        odd = self.rng.random() < self._odd_share
        return float(self.rng.choice(_ODD) if odd else usual * 10.0 ** self.rng.uniform(-4.0, 2.0))

    def place(self):
        return np.array([self.number(30.0), self.number(30.0)])

    def spread(self):
        """As often as not the two halves of the matrix disagree."""
        a, b = self.positive(), self.positive()
        across, again = (self.number(0.5 * min(abs(a), 1e3)) for _ in range(2))
        return np.array([[a, across], [across if self.rng.random() < 0.5 else again, b]])

    def interval(self):
        """Often that of the epochs."""
        return 0.1 if self.rng.random() < 0.7 else self.positive(0.5)

    def epoch(self):
        rng = self.rng
        self.stamp_ns += int(rng.choice([0, 1, 100, 500, 2_000, 60_000])) * NS_PER_MS
        source = Source.RANGE if rng.random() < 0.7 else Source.TDOA
        items = [
            MeasuredRange(
                int(rng.integers(1, 7)), abs(self.number(20.0)), self.positive(), int(rng.integers(-(10**9), 10**9)),
                self.number(), self.number(80.0),
            )
            for _ in range(rng.integers(0, 7))
        ]  # fmt: skip
        measured, _ = self._intake.take(1, self.stamp_ns, items, self._height_m, source)
        return EpochInputs(
            self.stamp_ns,
            tuple(PositionFix(self.place(), self.spread(), self.number()) for _ in range(rng.integers(0, 3))),
            tuple(
                StepFix(self.number(), self.positive(), self.number(2.0), self.positive(), self.positive(0.5))
                for _ in range(rng.integers(0, 3))
            ),
            (measured,) if len(measured) else (),
            tuple(
                PlaceFix(Source(rng.choice([Source.LANDMARK, Source.REGION])), self.place(), self.spread())
                for _ in range(rng.integers(0, 3))
            ),
            tuple(
                VelocityChange(np.array([self.number(), self.number(), self.number()]), self.interval())
                for _ in range(rng.integers(0, 3))
            ),
        )
