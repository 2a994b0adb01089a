"""Positions of a solver along a walk, and their errors."""

import numpy as np
from numpy.typing import NDArray
from uwb_paper_d_walks import Walk

from mine_loc_uwb.solver import Solver

Reals = NDArray[np.float64]


def positions_m(solver: Solver, walk: Walk) -> Reals:
    """Position after each blink (n, 3), NaN without one."""
    return np.array([solver.solve(blink).fix.position_m for blink in walk.blinks])


def error_m(position_m: Reals, walk: Walk) -> Reals:
    """Horizontal error (n,), NaN without a position."""
    return np.linalg.norm((position_m - walk.truth_m)[:, :2], axis=1)


def held_error_m(position_m: Reals, walk: Walk) -> Reals:
    """The same (n,) where the last position stands in for a missing one, before the first the middle of the nodes."""
    latest = np.maximum.accumulate(np.where(np.isfinite(position_m[:, 0]), np.arange(len(position_m)), -1))
    return error_m(np.where(latest[:, None] >= 0, position_m[latest], walk.anchors_m.mean(axis=0)), walk)
