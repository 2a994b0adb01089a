"""Blinks and rounds for tests of solvers."""

import numpy as np

from mine_loc_uwb.fix import FixStatus
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.path_loss import PathLoss

LOSS = PathLoss(-71.0, 2.15, 6.0)
TRIANGLE = np.array([[0.0, 0.0, 2.4], [20.0, 0.0, 2.4], [10.0, 17.32, 2.4]])
SQUARE = np.array([[0.0, 0.0, 2.4], [20.0, 0.0, 2.0], [20.0, 20.0, 2.6], [0.0, 20.0, 2.4], [8.0, 3.0, 0.5]])


def place(stamp_s):
    """Where a tag on a straight walk is."""
    return np.array([3.0, 3.0, 1.1]) + stamp_s * np.array([1.0, 0.3, 0.0])


def measure(anchors, tag, *, stamp_s=0.0, shared=True, errors=None, levels=None, height=True, sd_m=0.05):
    """One blink, or round of ranges, of a tag at a place (3,), with errors (n,) added."""
    count = len(anchors)
    ranges = np.linalg.norm(anchors - tag, axis=1)
    arrivals = ranges + (0.0 if errors is None else errors)
    if shared and count:
        arrivals = arrivals - arrivals[0]
    return Measurements(
        stamp_ns=round(1e9 * stamp_s),
        anchor_ids=np.arange(1, count + 1, dtype=np.uint64),
        anchors_m=np.asarray(anchors, float).reshape(-1, 3),
        range_m=arrivals,
        variance_m2=np.full(count, sd_m**2),
        since_s=np.zeros(count),
        los_probability=np.full(count, np.nan),
        receive_power_dbm=LOSS.level_dbm(ranges) if levels is None else levels,
        height_m=float(tag[2]) if height else None,
        shared_offset=shared,
    )


def is_covariance(matrix):
    return bool(np.isfinite(matrix).all() and np.allclose(matrix, matrix.T) and np.linalg.eigvalsh(matrix)[0] >= -1e-9)


def assert_finite_or_none(solver, rng, anchors, *, blinks, shared, height):
    """Pauses, links unheard, arrivals late or far too early, levels at random: every fix is a sound one or none."""
    stamp_s = 0.0
    for _ in range(blinks):
        stamp_s += rng.exponential(0.3) + 20.0 * (rng.random() < 0.05)
        heard = anchors[rng.random(len(anchors)) < 0.8]
        errors = rng.exponential(1.0, len(heard)) - 45.0 * (rng.random(len(heard)) < 0.1)
        levels = rng.uniform(-110, -60, len(heard))
        levels[rng.random(len(heard)) < 0.2] = np.nan
        options = {"shared": shared, "height": height, "errors": errors, "levels": levels}
        solution = solver.solve(measure(heard, place(stamp_s % 10), stamp_s=stamp_s, **options))
        assert len(solution.reasons) == len(heard)
        assert np.isfinite(solution.fix.position_m).all() == (solution.fix.status is FixStatus.OK)
        if solution.fix.status is FixStatus.OK:
            assert is_covariance(solution.fix.covariance_m2)
