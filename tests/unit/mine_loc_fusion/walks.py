"""People who walk in a hall of anchors, and what the fusion is told of them: ranges, positions, steps."""

import math
from dataclasses import dataclass, field

import numpy as np

from mine_loc_core.stamps import NS_PER_S, to_ns
from mine_loc_core.verdicts import Source
from mine_loc_fusion.estimate import EpochInputs, PlaceFix, PositionFix, StepFix
from mine_loc_uwb.measurements import Measurements

T0 = 1_760_000_000 * NS_PER_S
HALL = np.array([[0.0, 0.0, 2.4], [30.0, 0.0, 0.3], [30.0, 22.0, 2.4], [0.0, 22.0, 0.3], [15.0, -1.0, 3.5]])
HEIGHT_M = 1.0
PERIOD_S = 0.1
STEP_EVERY = 5
"""Epochs; a person takes a step of SPEED_M_S / 2 metres in so many."""
SPEED_M_S = 1.2
RADIUS_M = 1.5
"""Of the curve that a person takes round a corner."""


def at(seconds):
    return T0 + to_ns(seconds)


def position_fix(x, y, sd_m=0.1, los=math.nan):
    return PositionFix(np.array([x, y], float), np.eye(2) * sd_m**2, los)


def place_fix(x, y, sd_m=1.0, source=Source.LANDMARK):
    return PlaceFix(source, np.array([x, y], float), np.eye(2) * sd_m**2)


def step_fix(length_m=0.6, heading_rad=0.0, interval_s=0.5):
    return StepFix(length_m, 0.06**2, heading_rad, 0.05**2, interval_s)


def ranges_to(place_m, stamp_ns, *, noise_m=0.0, excess_m=0.0, anchors=HALL, space=False):
    """Ranges from (x, y) to all anchors; in `space` the height is to be solved for."""
    true_m = np.linalg.norm(anchors - [*place_m, HEIGHT_M], axis=1)
    unknown = np.full(len(anchors), math.nan)
    return Measurements(
        stamp_ns,
        np.arange(1, len(anchors) + 1, dtype=np.uint64),
        anchors,
        true_m + noise_m + excess_m,
        np.full(len(anchors), 0.05**2),
        np.zeros(len(anchors)),
        unknown,
        unknown,
        None if space else HEIGHT_M,
    )


@dataclass
class Walk:
    """Round and round a rectangle with round corners: ranges ten times and steps twice a second, the first from rest.

    The odom frame is turned by −yaw; steps are reported `step_scale` times as long as they are.
    """

    yaw_rad: float = 0.7
    step_scale: float = 1.0
    seed: int = 0
    space: bool = False
    radius_m: float = RADIUS_M
    range_sd_m: float = 0.05
    heading_sd_rad: float = 0.02
    number: int = 0
    place_m: np.ndarray = field(default_factory=lambda: np.array([5.0, 5.0]))

    def __post_init__(self):
        self.rng = np.random.default_rng(self.seed)
        self.strike_m = self.place_m.copy()

    @property
    def at_s(self):
        return self.number * PERIOD_S

    @property
    def stamp_ns(self):
        return at(self.at_s)

    def next(self, *, ranges=True, positions=False, steps=True, excess_m=0.0):
        """The epoch of the next tenth of a second."""
        self.number += 1
        self.place_m = _on_rectangle(SPEED_M_S * self.at_s, radius_m=self.radius_m)
        taken, stamp_ns = (), self.stamp_ns
        if self.number % STEP_EVERY == 0:
            way_m = self.place_m - self.strike_m
            self.strike_m = self.place_m.copy()
            heading_rad = math.atan2(way_m[1], way_m[0]) - self.yaw_rad + self.rng.normal(0.0, self.heading_sd_rad)
            length_m = float(np.hypot(*way_m)) * self.step_scale + self.rng.normal(0.0, 0.02)
            first = self.number == STEP_EVERY
            taken = (step_fix(length_m, heading_rad, math.nan if first else STEP_EVERY * PERIOD_S),)
        noise_m = self.rng.normal(0.0, self.range_sd_m, len(HALL))
        round_ = ranges_to(self.place_m, stamp_ns, noise_m=noise_m, excess_m=excess_m, space=self.space)
        fix = position_fix(*(self.place_m + self.rng.normal(0.0, 0.1, 2)), los=1.0)
        return EpochInputs(
            stamp_ns,
            positions=(fix,) if positions else (),
            steps=taken if steps else (),
            ranges=(round_,) if ranges else (),
        )

    def play(self, subject, seconds, **what):
        """Give it to an estimator for so long; the errors of position [m], one an epoch."""
        errors = []
        for _ in range(round(seconds / PERIOD_S)):
            subject.update(self.next(**what))
            errors.append(self.error_m(subject))
        return np.array(errors)

    def error_m(self, subject):
        estimate = subject.estimate(self.stamp_ns)
        return math.inf if estimate is None else float(np.linalg.norm(estimate.position_m - self.place_m))


def _on_rectangle(way_m, east_m=18.0, north_m=9.0, *, radius_m):
    """Where somebody is after so much of a way round a rectangle with round corners, from (5, 5) east."""
    sides_m, arc_m = (east_m, north_m, east_m, north_m), radius_m * math.pi / 2.0
    place_m, heading_rad, left_m = np.array([5.0, 5.0]), 0.0, way_m % (2.0 * (east_m + north_m) + 4.0 * arc_m)
    for side_m in sides_m:
        straight_m = min(left_m, side_m)
        place_m = place_m + straight_m * np.array([math.cos(heading_rad), math.sin(heading_rad)])
        left_m -= straight_m
        turned_rad = min(left_m, arc_m) / radius_m
        chord = np.array([math.sin(turned_rad), 1.0 - math.cos(turned_rad)]) * radius_m
        c, s = math.cos(heading_rad), math.sin(heading_rad)
        place_m = place_m + np.array([[c, -s], [s, c]]) @ chord
        heading_rad, left_m = heading_rad + turned_rad, max(left_m - arc_m, 0.0)
    return place_m


def is_covariance(matrix):
    """Finite, symmetric and positive semi-definite, to rounding."""
    if not (np.isfinite(matrix).all() and np.allclose(matrix, matrix.T, rtol=1e-9, atol=1e-12)):
        return False
    return bool(np.linalg.eigvalsh(matrix)[0] >= -1e-9 * max(1e-6, np.abs(matrix).max()))
