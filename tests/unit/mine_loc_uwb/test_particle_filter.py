"""The particle filter: as good as Kalman's where noise is normal, better where it is late, and never lost for long."""

import numpy as np
import pytest
from blinks import LOSS, SQUARE, TRIANGLE, assert_finite_or_none, measure, place
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_core.verdicts import Reason
from mine_loc_uwb.ekf import Ekf, EkfParameters
from mine_loc_uwb.fix import FixStatus
from mine_loc_uwb.late_arrival import LateArrival
from mine_loc_uwb.particle_filter import ParticleFilter, ParticleFilterParameters

ON_TIME = LateArrival(late_probability=0.0)
NORMAL = ParticleFilterParameters(LOSS, 0.01, core_sd_m=0.05, law=ON_TIME)
KALMAN = EkfParameters(LOSS, 0.01, excess_sd_m=0.05)
LATE = ParticleFilterParameters(LOSS, 0.01, core_sd_m=0.05, law=LateArrival(0.5, 2.0))


def follow(solver, anchors, seed=1, count=100, late=0.0, **options):
    """Solutions and places of a walk at 20 Hz with errors of 7 cm, a share of them late by 2 m on average."""
    rng, found = np.random.default_rng(seed), []
    for stamp_s in np.arange(count) * 0.05:
        errors = rng.normal(0, 0.07, len(anchors))
        errors += rng.exponential(2.0, len(anchors)) * (rng.random(len(anchors)) < late)
        blink = measure(anchors, place(stamp_s), stamp_s=stamp_s, errors=errors, **options)
        found.append((solver.solve(blink), place(stamp_s)))
    return found


def mean_error(found):
    return np.nanmean([np.linalg.norm(solution.fix.position_m - tag) for solution, tag in found[20:]])


@pytest.mark.parametrize("options", [{}, {"shared": False}, {"height": False}])
def test_with_normal_noise_it_is_as_good_as_a_kalman_filter(options):
    pairs = [
        (
            mean_error(follow(ParticleFilter(NORMAL), SQUARE, seed=seed, **options)),
            mean_error(follow(Ekf(KALMAN), SQUARE, seed=seed, **options)),
        )
        for seed in range(3)
    ]
    ours, kalman = np.mean(pairs, axis=0)
    assert ours < 1.2 * kalman


def test_with_late_arrivals_it_is_better_than_a_kalman_filter_of_the_true_variance():
    true = EkfParameters(LOSS, 0.01, excess_sd_m=float(np.sqrt(LATE.law.moments(np.array(np.nan))[1])))
    pairs = [
        (
            mean_error(follow(ParticleFilter(LATE), TRIANGLE, seed=seed, late=0.5)),
            mean_error(follow(Ekf(true), TRIANGLE, seed=seed, late=0.5)),
        )
        for seed in range(4)
    ]
    ours, kalman = np.mean(pairs, axis=0)
    assert ours < 0.8 * kalman


def test_same_seed_same_track():
    one, other = (follow(ParticleFilter(LATE), TRIANGLE, count=10) for _ in range(2))
    for (first, _), (second, _) in zip(one, other, strict=True):
        assert np.array_equal(first.fix.position_m, second.fix.position_m)


def test_where_one_blink_gives_no_place_it_says_so_until_it_has_settled():
    found = follow(ParticleFilter(NORMAL), TRIANGLE[:2], count=1)
    assert found[0][0].fix.status is FixStatus.DEGENERATE
    assert np.isnan(found[0][0].fix.position_m).all()
    assert ParticleFilter(NORMAL).solve(measure(TRIANGLE[:1], place(0.0))).reasons == (Reason.NOT_INITIALISED,)


@pytest.mark.parametrize("link", range(5))
def test_an_early_outlier_is_rejected_at_the_gate_whichever_link_it_is_on(link):
    solver = ParticleFilter(NORMAL)
    follow(solver, SQUARE, count=40)
    errors = np.zeros(5)
    errors[link] = -45.0
    solution = solver.solve(measure(SQUARE, place(2.0), stamp_s=2.0, errors=errors))
    assert list(solution.reasons) == [Reason.GATE if number == link else Reason.ACCEPTED for number in range(5)]
    assert solution.mahalanobis_sq[link] > solution.gate
    assert solution.fix.position_m == pytest.approx(place(2.0), abs=0.15)


def test_a_late_outlier_is_kept_and_does_no_harm():
    solver = ParticleFilter(LATE)
    follow(solver, SQUARE, count=40)
    solution = solver.solve(measure(SQUARE, place(2.0), stamp_s=2.0, errors=np.array([0.0, 25.0, 0.0, 0.0, 0.0])))
    assert solution.reasons == (Reason.ACCEPTED,) * 5
    assert solution.fix.position_m == pytest.approx(place(2.0), abs=0.15)


def test_after_a_long_silence_it_begins_anew():
    solver, far = ParticleFilter(NORMAL), np.array([12.0, 4.0, 1.1])
    follow(solver, TRIANGLE, count=40)
    solution = solver.solve(measure(TRIANGLE, far, stamp_s=32.0))
    assert solution.fix.position_m == pytest.approx(far, abs=0.1)
    assert solution.reasons == (Reason.ACCEPTED,) * 3


def test_after_lasting_contradiction_it_begins_anew():
    solver, elsewhere, reasons = ParticleFilter(NORMAL), np.array([14.0, 14.0, 1.1]), []
    follow(solver, SQUARE, count=40)
    for stamp_s in np.arange(2.0, 4.0, 0.05):
        solution = solver.solve(measure(SQUARE, elsewhere, stamp_s=stamp_s))
        reasons += solution.reasons
    assert Reason.GATE in reasons
    assert solution.fix.position_m == pytest.approx(elsewhere, abs=0.1)


def test_uncertainty_grows_while_nothing_is_heard():
    solver = ParticleFilter(NORMAL)
    follow(solver, TRIANGLE, count=60)
    sizes = [np.trace(solver.solve(measure(TRIANGLE[:0], place(t), stamp_s=t)).fix.covariance_m2) for t in (3, 4, 5, 6)]
    assert sizes == sorted(sizes)


def test_stamps_that_go_back_are_not_used():
    solver = ParticleFilter(NORMAL)
    follow(solver, TRIANGLE, count=40)
    assert solver.solve(measure(TRIANGLE, place(1.0), stamp_s=1.0)).reasons == (Reason.BACKWARD,) * 3


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.booleans(), st.booleans())
def test_whatever_is_measured_a_fix_is_finite_or_none(seed, count, shared, height):
    rng = np.random.default_rng(seed)
    anchors = rng.uniform(-30, 30, (count, 3))
    if rng.random() < 0.3:
        anchors[:, 1:] = anchors[0, 1:]  # on a line
    solver = ParticleFilter(ParticleFilterParameters(LOSS, particles=200))
    assert_finite_or_none(solver, rng, anchors, blinks=20, shared=shared, height=height)
