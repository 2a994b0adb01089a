"""Estimators over walks as live: rounds when they are measured, steps when they are reported."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from fusion_walks import Walk
from uwb_tracks import Array

from mine_loc_core.stamps import NS_PER_S
from mine_loc_fusion.estimate import EpochInputs, Estimator, PositionFix
from mine_loc_fusion.late_inputs import LateInputCorrector

HISTORY_NS = 2 * NS_PER_S
MakeEstimator = Callable[[Walk], Estimator]


@dataclass(frozen=True, slots=True)
class Run:
    """Estimates at the rounds of a walk: positions (n, 2), covariances (n, 2, 2), NaN before the first; cost."""

    position_m: Array
    covariance_m2: Array
    us_per_epoch: float


def epochs_of(walk: Walk, positions: Sequence[PositionFix | None] | None) -> list[tuple[int, EpochInputs, int | None]]:
    """(arrival, epoch, number of the round or None) in order of arrival; with `positions`, those instead of ranges."""
    rounds = [
        (
            r.stamp_ns,
            EpochInputs(r.stamp_ns, ranges=(r,))
            if positions is None
            else EpochInputs(r.stamp_ns, tuple(fix for fix in positions[n : n + 1] if fix is not None)),
            n,
        )
        for n, r in enumerate(walk.rounds)
    ]
    steps = [(s.reported_ns, EpochInputs(s.stamp_ns, steps=(s.fix,)), None) for s in walk.steps]
    return sorted(rounds + steps, key=lambda item: item[0])


def run_estimator(make: MakeEstimator, walk: Walk, positions: Sequence[PositionFix | None] | None = None) -> Run:
    """Estimates at each round with all that had arrived by then."""
    corrector = LateInputCorrector(make(walk), HISTORY_NS)
    epochs = epochs_of(walk, positions)
    position_m = np.full((len(walk.rounds), 2), np.nan)
    covariance_m2 = np.full((len(walk.rounds), 2, 2), np.nan)
    began = time.perf_counter()
    for _, inputs, number in epochs:
        corrector.update(inputs)
        if number is None:
            continue
        estimate = corrector.estimate(inputs.stamp_ns)
        if estimate is not None:
            position_m[number] = estimate.position_m
            covariance_m2[number] = estimate.covariance[:2, :2]
    spent_us = 1e6 * (time.perf_counter() - began) / len(walk.rounds)
    return Run(position_m, covariance_m2, spent_us)
