"""The extended Kalman filter: follows, claims what it errs, names what it rejects, and begins anew."""

import numpy as np
import pytest
from blinks import LOSS, SQUARE, TRIANGLE, assert_finite_or_none, measure, place
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_core.verdicts import Reason
from mine_loc_uwb.ekf import Ekf, EkfParameters
from mine_loc_uwb.fix import FixStatus

QUIET = EkfParameters(LOSS, jerk_density_m2_s5=0.01)


def follow(solver, anchors, seed=1, count=120, step_s=0.05, **options):
    """Solutions and places of a walk with errors of 5 cm."""
    rng, found = np.random.default_rng(seed), []
    for stamp_s in np.arange(count) * step_s:
        tag = place(stamp_s)
        found.append(
            (
                solver.solve(
                    measure(anchors, tag, stamp_s=stamp_s, errors=rng.normal(0, 0.05, len(anchors)), **options)
                ),
                tag,
            )
        )
    return found


@pytest.mark.parametrize("options", [{}, {"shared": False}, {"height": False}, {"shared": False, "height": False}])
def test_a_walk_is_followed_better_than_blink_by_blink(options):
    found = follow(Ekf(QUIET), SQUARE, **options)
    errors = [np.linalg.norm(solution.fix.position_m - tag) for solution, tag in found[40:]]
    assert all(solution.fix.status is FixStatus.OK for solution, _ in found)
    assert np.mean(errors) < 0.05 * found[-1][0].fix.gdop


def test_the_claimed_covariance_is_that_of_the_errors():
    nees = []
    for seed in range(20):
        # Levels are exact here: with their own noise left out of the estimate the claim is of arrivals alone.
        solver = Ekf(EkfParameters(None, jerk_density_m2_s5=1e-4))
        solution, tag = follow(solver, SQUARE, seed=seed, count=60)[-1]
        error = (solution.fix.position_m - tag)[:2]
        nees.append(error @ np.linalg.solve(solution.fix.covariance_m2[:2, :2], error))
    assert 0.8 < np.mean(nees) < 3.5


def test_irregular_intervals_and_exchanges_at_their_own_instants():
    solver, rng, stamp_s = Ekf(EkfParameters(None)), np.random.default_rng(2), 0.0
    for _ in range(80):
        stamp_s += rng.uniform(0.01, 0.6)
        since_s = np.linspace(-0.04, 0.0, len(SQUARE))
        ranges = np.array([np.linalg.norm(a - place(stamp_s + s)) for a, s in zip(SQUARE, since_s, strict=True)])
        blink = measure(SQUARE, place(stamp_s), stamp_s=stamp_s, shared=False)
        blink.range_m[:], blink.since_s[:] = ranges, since_s
        solution = solver.solve(blink)
    assert solution.fix.position_m == pytest.approx(place(stamp_s), abs=0.03)


@pytest.mark.parametrize("outlier_m", [-45.0, 30.0])
@pytest.mark.parametrize("link", range(5))
def test_an_outlier_is_rejected_at_the_gate_whichever_link_it_is_on(outlier_m, link):
    solver = Ekf(QUIET)
    follow(solver, SQUARE, count=40)
    errors = np.zeros(5)
    errors[link] = outlier_m
    solution = solver.solve(measure(SQUARE, place(2.0), stamp_s=2.0, errors=errors))
    expected = [Reason.GATE if number == link else Reason.ACCEPTED for number in range(5)]
    assert list(solution.reasons) == expected
    assert solution.mahalanobis_sq[link] > solution.gate
    assert solution.fix.position_m == pytest.approx(place(2.0), abs=0.1)


def test_uncertainty_grows_while_one_link_or_none_is_heard():
    solver = Ekf(QUIET)
    follow(solver, TRIANGLE, count=60)
    sizes = [
        np.trace(solver.solve(measure(TRIANGLE[:heard], place(t), stamp_s=t)).fix.covariance_m2)
        for t, heard in [(3.5, 0), (4.5, 1), (5.5, 0), (6.5, 1)]
    ]
    assert sizes == sorted(sizes)
    assert sizes[-1] > 4 * sizes[0]


def test_after_a_long_silence_it_begins_anew():
    solver = Ekf(QUIET)
    follow(solver, TRIANGLE, count=60)
    far = np.array([12.0, 4.0, 1.1])
    assert solver.solve(measure(TRIANGLE[:1], far, stamp_s=33.0)).reasons == (Reason.DEGENERATE,)
    solution = solver.solve(measure(TRIANGLE, far, stamp_s=33.5))
    assert solution.fix.position_m == pytest.approx(far, abs=0.01)
    assert solution.reasons == (Reason.ACCEPTED,) * 3


def test_after_lasting_contradiction_it_begins_anew():
    solver, elsewhere = Ekf(QUIET), np.array([14.0, 14.0, 1.1])
    follow(solver, SQUARE, count=60)
    reasons = []
    for stamp_s in np.arange(3.0, 5.0, 0.05):
        solution = solver.solve(measure(SQUARE, elsewhere, stamp_s=stamp_s))
        reasons += solution.reasons
    assert Reason.GATE in reasons
    assert solution.fix.position_m == pytest.approx(elsewhere, abs=0.05)


def test_stamps_that_go_back_are_not_used():
    solver = Ekf(QUIET)
    follow(solver, TRIANGLE, count=60)
    solution = solver.solve(measure(TRIANGLE, place(2.0), stamp_s=2.0))
    assert solution.reasons == (Reason.BACKWARD,) * 3
    assert np.isfinite(solution.fix.position_m).all()


def test_nodes_on_a_line_never_begin_a_track():
    line = SQUARE * [1, 0, 0] + [0, 1, 2]
    for solution, _ in follow(Ekf(EkfParameters()), line, count=5):
        assert solution.fix.status is FixStatus.DEGENERATE
        assert set(solution.reasons) == {Reason.DEGENERATE}


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.booleans(), st.booleans())
def test_whatever_is_measured_a_fix_is_finite_or_none(seed, count, shared, height):
    rng = np.random.default_rng(seed)
    anchors = rng.uniform(-30, 30, (count, 3))
    assert_finite_or_none(Ekf(QUIET), rng, anchors, blinks=30, shared=shared, height=height)
