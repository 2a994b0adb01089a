"""TDOA and TDOA/RSS: exact where it can be, two roots told apart or said to be two, no wild fix."""

import numpy as np
import pytest
from blinks import LOSS, SQUARE, TRIANGLE, is_covariance, measure
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mine_loc_core.verdicts import Reason
from mine_loc_uwb.blink_likelihood import TdoaRssParameters, Whereabouts
from mine_loc_uwb.fix import FixStatus
from mine_loc_uwb.late_arrival import LateArrival
from mine_loc_uwb.tdoa_rss import TdoaRss, solve_blink

ALONE, JOINT = TdoaRssParameters(), TdoaRssParameters(LOSS)
seeds = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("parameters", [ALONE, JOINT])
@pytest.mark.parametrize("tag", [(10.0, 6.0, 1.1), (5.0, 3.0, 1.1), (13.0, 9.0, 2.4)])
def test_three_nodes_and_the_closure_give_the_exact_place(parameters, tag):
    fix, reason = solve_blink(measure(TRIANGLE, np.array(tag)), parameters)
    assert (fix.status, reason, fix.dimensions) == (FixStatus.OK, Reason.ACCEPTED, 2)
    assert fix.position_m == pytest.approx(tag, abs=1e-3)


@settings(max_examples=60)
@given(seeds, st.sampled_from([ALONE, JOINT]), st.booleans(), st.booleans(), st.sampled_from([0.0, 5e3]))
def test_exact_arrivals_of_many_nodes_give_the_exact_place(seed, parameters, shared, height, origin):
    rng = np.random.default_rng(seed)
    anchors, tag = rng.uniform(0, 40, (7, 3)) + origin, rng.uniform(5, 35, 3) + origin
    fix, _ = solve_blink(measure(anchors, tag, shared=shared, height=height), parameters)
    assume(fix.status is FixStatus.OK)
    assert fix.position_m == pytest.approx(tag, abs=0.02)
    assert is_covariance(fix.covariance_m2)


@settings(max_examples=60)
@given(seeds, st.integers(0, 8), st.booleans(), st.booleans())
def test_whatever_is_measured_a_fix_is_finite_or_none(seed, count, shared, height):
    rng = np.random.default_rng(seed)
    anchors, tag = rng.uniform(-30, 30, (count, 3)), rng.uniform(-30, 30, 3)
    errors, levels = 20.0 * rng.standard_normal(count), rng.uniform(-110, -60, count)
    levels[rng.random(count) < 0.3] = np.nan
    blink = measure(anchors, tag, shared=shared, height=height, errors=errors, levels=levels)
    for parameters in (ALONE, JOINT):
        fix, reason = solve_blink(blink, parameters)
        assert (fix.status is FixStatus.OK) == (reason is Reason.ACCEPTED)
        assert np.isfinite(fix.position_m).all() == (fix.status is FixStatus.OK)
        if fix.status is FixStatus.OK:
            assert is_covariance(fix.covariance_m2)


@pytest.mark.parametrize(("height", "enough"), [(True, 3), (False, 4)])
def test_too_few_nodes_give_no_position(height, enough):
    for count in range(enough):
        fix, reason = solve_blink(measure(SQUARE[:count], np.array([5.0, 6.0, 1.1]), height=height), JOINT)
        assert (fix.status, reason) == (FixStatus.TOO_FEW_RANGES, Reason.DEGENERATE)


@settings(max_examples=30)
@given(seeds, st.floats(-3.1, 3.1))
def test_nodes_on_a_line_or_in_one_place_determine_nothing(seed, yaw):
    rng = np.random.default_rng(seed)
    along = rng.uniform(-50, 50, (5, 1)) * [np.cos(yaw), np.sin(yaw), 0.0]
    for anchors in (along, np.repeat(along[:1], 5, axis=0)):
        blink = measure(anchors, np.array([3.0, 4.0, 1.0]), errors=rng.normal(0, 0.05, 5))
        fix, reason = solve_blink(blink, ALONE)
        assert (fix.status, reason) == (FixStatus.DEGENERATE, Reason.DEGENERATE)


def ambiguous_blink():
    """Behind the corner of a triangle two places have the same time differences."""
    return measure(TRIANGLE, np.array([-2.0, 1.0, 1.1]), levels=np.full(3, np.nan))


def test_two_roots_are_said_to_be_two():
    fix, reason = solve_blink(ambiguous_blink(), ALONE)
    assert (fix.status, reason) == (FixStatus.DEGENERATE, Reason.AMBIGUOUS)


def test_the_last_place_chooses_between_roots():
    last = Whereabouts(np.array([-1.8, 1.0, 1.1]), 0.1)
    fix, reason = solve_blink(ambiguous_blink(), ALONE, last)
    assert reason is Reason.ACCEPTED
    assert fix.position_m == pytest.approx([-2.0, 1.0, 1.1], abs=1e-3)


def test_levels_choose_between_roots():
    sharp = TdoaRssParameters(type(LOSS)(LOSS.level_1m_dbm, LOSS.exponent, 1.0))
    fix, reason = solve_blink(measure(TRIANGLE, np.array([-2.0, 1.0, 1.1])), sharp)
    assert reason is Reason.ACCEPTED
    assert fix.position_m == pytest.approx([-2.0, 1.0, 1.1], abs=0.05)


def test_a_late_second_blink_does_not_lean_on_the_last_place():
    solver = TdoaRss(ALONE)
    first = solver.solve(measure(TRIANGLE, np.array([2.0, 2.0, 1.1])))
    assert first.fix.status is FixStatus.OK
    late = measure(TRIANGLE, np.array([-2.0, 1.0, 1.1]), stamp_s=30.0)
    assert solver.solve(late).reasons == (Reason.AMBIGUOUS,) * 3


def test_time_differences_that_no_place_has_are_invalid():
    fix, reason = solve_blink(measure(SQUARE, np.array([6.0, 9.0, 1.1]), errors=np.array([0, -45.0, 0, 0, 0])), ALONE)
    assert (fix.status, reason) == (FixStatus.DIVERGED, Reason.INVALID)
    assert np.isnan(fix.position_m).all()


def test_geometry_beyond_the_limit_is_degenerate_and_says_how_bad_it_is():
    fix, reason = solve_blink(
        measure(TRIANGLE * [1, 0.02, 1], np.array([8.0, 0.1, 1.1])), TdoaRssParameters(max_gdop=3.0)
    )
    assert reason is Reason.DEGENERATE
    assert fix.gdop > 3.0


def test_levels_help_where_time_differences_are_bad():
    rng, tag, errors = np.random.default_rng(3), np.array([7.0, 5.0, 1.1]), {ALONE: [], JOINT: []}
    bad = {each: TdoaRssParameters(each.path_loss, excess_sd_m=5.0, max_gdop=1e3) for each in errors}
    for _ in range(300):
        levels = LOSS.level_dbm(np.linalg.norm(TRIANGLE - tag, axis=1)) + LOSS.shadowing_db * rng.standard_normal(3)
        blink = measure(TRIANGLE, tag, errors=5.0 * rng.standard_normal(3), levels=levels)
        for each, parameters in bad.items():
            errors[each].append(np.linalg.norm(solve_blink(blink, parameters)[0].position_m - tag))
    both = np.isfinite(errors[ALONE]) & np.isfinite(errors[JOINT])
    assert both.sum() > 100
    assert np.array(errors[JOINT])[both].mean() < np.array(errors[ALONE])[both].mean()


def test_the_claimed_covariance_is_that_of_the_errors():
    rng, tag, runs, nees = np.random.default_rng(5), np.array([9.0, 6.0, 1.1]), 800, []
    for _ in range(runs):
        fix, _ = solve_blink(measure(TRIANGLE, tag, errors=rng.normal(0, 0.05, 3)), ALONE)
        error = (fix.position_m - tag)[:2]
        nees.append(error @ np.linalg.solve(fix.covariance_m2[:2, :2], error))
    assert np.mean(nees) == pytest.approx(2.0, abs=1.96 * np.sqrt(4 / runs))


def test_lateness_known_by_level_is_taken_off():
    law, tag = LateArrival(1.0, 1.0, 0.2), np.array([7.0, 5.0, 1.1])
    levels = np.array([-88.0, -100.0, -92.0])
    late_m, _ = law.moments(levels)
    fix, _ = solve_blink(measure(TRIANGLE, tag, errors=late_m, levels=levels), TdoaRssParameters(law=law))
    assert fix.position_m == pytest.approx(tag, abs=1e-3)
