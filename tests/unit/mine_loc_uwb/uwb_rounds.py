"""Rounds of one tag in a hall of five anchors, as a driver would tell them to the round solver."""

import math

from mine_loc_core.site import Anchor
from mine_loc_core.stamps import NS_PER_S
from mine_loc_uwb.parameters import UwbSolverParameters
from mine_loc_uwb.range_intake import MeasuredRange
from mine_loc_uwb.round_solver import RoundSolver

PLACES = {1: (0.0, 0.0, 2.4), 2: (60.0, 2.0, 2.4), 3: (58.0, 45.0, 2.4), 4: (1.0, 46.0, 2.4), 5: (30.0, 20.0, 2.4)}
TAG = (20.0, 12.0, 1.0)


NOW_NS = 1_000 * NS_PER_S


def solver(places=None, offset_m=0.0, method="robust_tracker"):
    anchors = [Anchor(i, str(i), place, 0.0, offset_m) for i, place in (places or PLACES).items()]
    return RoundSolver(anchors, UwbSolverParameters(method=method))


class Rounds:
    """Gives a solver one round after another, each 0.1 s after the last and heard as it comes."""

    def __init__(self, subject: RoundSolver) -> None:
        self.subject, self.stamp_ns = subject, NOW_NS

    def solve(self, measured, height_m=1.0, tag=7):
        self.stamp_ns += NS_PER_S // 10
        return self.subject.solve(tag, self.stamp_ns, self.stamp_ns, measured, height_m)


def solve(measured, height_m=1.0, **what):
    """One round of plain least squares, so that the fix is that of this round."""
    return Rounds(solver(method="least_squares", **what)).solve(measured, height_m)


def ranges(tag=TAG, places=None, noise=lambda: 0.0):
    places = places or PLACES
    return [MeasuredRange(i, math.dist(place, tag) + noise(), 0.01) for i, place in places.items()]


def noisy(rng, sd_m=0.02, **what):
    return ranges(noise=lambda: rng.normal(0, sd_m), **what)


def reasons(verdicts):
    return [verdict.reason for verdict in verdicts]
