"""From a round to a position: every range gets its verdict, and only good ones are used."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from uwb_rounds import NOW_NS, PLACES, TAG, Rounds, noisy, ranges, reasons, solve, solver
from uwb_scenes import is_covariance

from mine_loc_core.site import Anchor
from mine_loc_core.stamps import NS_PER_S
from mine_loc_core.verdicts import Reason, Source
from mine_loc_uwb.fix import FixStatus
from mine_loc_uwb.parameters import RANGE_METHODS, UwbSolverParameters
from mine_loc_uwb.range_intake import MeasuredRange
from mine_loc_uwb.round_solver import RoundSolver
from mine_loc_uwb.solvers import RANGE_SOLVERS


def test_a_good_round_gives_a_position_and_accepts_each_range_in_order():
    fix, verdicts = solve(ranges())
    assert fix.position_m == pytest.approx(TAG, abs=1e-6)
    assert [(v.source, v.sensor_id, v.reason) for v in verdicts] == [(Source.RANGE, i, Reason.ACCEPTED) for i in PLACES]
    assert [v.innovation for v in verdicts] == pytest.approx([0.0] * 5, abs=1e-6)


def test_an_anchors_range_offset_is_taken_off():
    late = [MeasuredRange(item.anchor_id, item.range_m + 0.8, 0.01) for item in ranges()]
    assert solve(late, offset_m=0.8)[0].position_m == pytest.approx(TAG, abs=1e-6)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 0.0, -3.0, 300.1, 1e300])
def test_an_impossible_range_is_invalid_and_not_used(value):
    bad = [*ranges()[:4], MeasuredRange(5, value, 0.01)]
    fix, verdicts = solve(bad)
    assert reasons(verdicts) == [Reason.ACCEPTED] * 4 + [Reason.INVALID]
    assert fix.position_m == pytest.approx(TAG, abs=1e-6)
    assert fix.ranges_used == 4


def test_an_anchor_that_the_site_does_not_know_is_told_and_not_used():
    fix, verdicts = solve([MeasuredRange(99, 3.0, 0.01), *ranges()])
    assert reasons(verdicts) == [Reason.UNKNOWN_SENSOR] + [Reason.ACCEPTED] * 5
    assert fix.position_m == pytest.approx(TAG, abs=1e-6)


def test_a_disabled_anchor_is_left_out_until_it_is_enabled():
    rounds = Rounds(solver())
    rounds.subject.intake.disabled.add(2)
    assert reasons(rounds.solve(ranges())[1])[1] is Reason.DISABLED
    rounds.subject.intake.disabled.clear()
    assert reasons(rounds.solve(ranges())[1])[1] is Reason.ACCEPTED


def test_the_second_range_of_an_anchor_is_a_duplicate():
    fix, verdicts = solve([*ranges(), MeasuredRange(1, 5.0, 0.01)])
    assert reasons(verdicts) == [Reason.ACCEPTED] * 5 + [Reason.DUPLICATE]
    assert fix.position_m == pytest.approx(TAG, abs=1e-6)


def test_a_good_range_after_a_failed_one_of_the_same_anchor_is_used():
    _, verdicts = solve([MeasuredRange(1, math.nan, 0.01), *ranges()])
    assert reasons(verdicts) == [Reason.INVALID] + [Reason.ACCEPTED] * 5


@pytest.mark.parametrize("method", RANGE_METHODS)
def test_a_value_that_repeats_without_noise_is_frozen_and_thaws_when_it_moves(method):
    rng, rounds = np.random.default_rng(1), Rounds(solver(method=method))
    true_m = ranges()[0].range_m

    def play(stuck_m):
        return reasons(rounds.solve([MeasuredRange(1, stuck_m, 0.01), *noisy(rng)[1:]])[1])

    history = [play(true_m)[0] for _ in range(40)]
    assert history[:20] == [Reason.ACCEPTED] * 20
    assert history[20:] == [Reason.FROZEN] * 20
    assert play(true_m + 0.1) == [Reason.ACCEPTED] * 5
    for _ in range(30):
        assert Reason.FROZEN not in play(true_m + rng.normal(0, 0.02))


def test_a_frozen_anchor_does_not_hold_the_walker_back():
    rng, rounds = np.random.default_rng(3), Rounds(solver())
    for number in range(60):
        place = (20.0 + 0.1 * number, 12.0, 1.0)
        fix, verdicts = rounds.solve([MeasuredRange(1, math.dist(PLACES[1], TAG), 0.01), *noisy(rng, tag=place)[1:]])
    assert reasons(verdicts) == [Reason.FROZEN] + [Reason.ACCEPTED] * 4
    assert math.dist(fix.position_m, place) < 0.25


def test_duplicates_within_a_round_do_not_count_as_repeats():
    rounds, rng = Rounds(solver()), np.random.default_rng(2)
    for _ in range(30):
        assert Reason.FROZEN not in reasons(rounds.solve(noisy(rng) * 5)[1])


def test_tags_are_judged_apart_and_a_forgotten_tag_starts_anew():
    rounds = Rounds(solver())
    for _ in range(25):
        rounds.solve(ranges())
    assert set(reasons(rounds.solve(ranges(), tag=8)[1])) == {Reason.ACCEPTED}
    assert set(reasons(rounds.solve(ranges())[1])) == {Reason.FROZEN}
    rounds.subject.forget(7)
    assert set(reasons(rounds.solve(ranges())[1])) == {Reason.ACCEPTED}


@pytest.mark.parametrize("used", [0, 2])
def test_ranges_that_do_not_determine_a_position_are_not_called_accepted(used):
    fix, verdicts = solve(ranges()[:used])
    assert fix.status is FixStatus.TOO_FEW_RANGES
    assert reasons(verdicts) == [Reason.DEGENERATE] * used


def test_all_anchors_on_a_line_give_no_position_and_say_why():
    places = {i: (10.0 * i, 5.0, 2.4) for i in range(1, 7)}
    fix, verdicts = solve(ranges(places=places), places=places)
    assert fix.status is FixStatus.DEGENERATE
    assert set(reasons(verdicts)) == {Reason.DEGENERATE}


def test_an_outlier_of_minus_45_m_is_refused_or_makes_the_claimed_area_wide():
    near, far = ranges(), ranges(tag=(2.0, 3.0, 1.0))
    near[4] = MeasuredRange(5, near[4].range_m - 45.0, 0.01)
    assert reasons(solve(near)[1])[4] is Reason.INVALID
    far[2] = MeasuredRange(3, far[2].range_m - 45.0, 0.01)
    fix, _ = solve(far)
    clean, _ = solve(ranges(tag=(2.0, 3.0, 1.0)))
    error_m = math.dist(fix.position_m, (2.0, 3.0, 1.0))
    claimed_m, clean_m = (math.sqrt(np.trace(covariance)) for covariance in (fix.covariance_m2, clean.covariance_m2))
    assert claimed_m > max(50 * clean_m, error_m / 2)
    assert fix.residual_rms_m > 1.0


@pytest.mark.parametrize("variance", [0.0, math.nan, math.inf, -1.0])
def test_an_unusable_variance_does_not_reach_the_covariance(variance):
    odd = [MeasuredRange(item.anchor_id, item.range_m, variance) for item in ranges()]
    fix, _ = solve(odd)
    assert np.isfinite(fix.covariance_m2).all()
    assert 0.0 < fix.covariance_m2[0, 0] < 1.0


NUMBER = st.floats() | st.floats(-1.0, 400.0)
ANY_RANGE = st.builds(
    MeasuredRange,
    st.integers(0, 10),
    NUMBER,
    NUMBER,
    st.integers(-(2**63), 2**63 - 1) | st.integers(-(10**8), 10**8),
    NUMBER,
    NUMBER,
)


@pytest.mark.parametrize("method", RANGE_METHODS)
@settings(max_examples=15)
@given(
    st.dictionaries(st.integers(1, 8), st.tuples(*[st.floats(-500.0, 500.0)] * 3), max_size=8),
    st.lists(st.lists(ANY_RANGE, max_size=12), min_size=1, max_size=4),
    st.none() | st.floats(-5.0, 5.0),
)
def test_any_rounds_on_any_anchors_give_finite_positions_or_say_why_not(method, places, played, height_m):
    rounds = Rounds(
        RoundSolver(
            [Anchor(i, str(i), place, 0.0, 0.0) for i, place in places.items()], UwbSolverParameters(method=method)
        )
    )
    for measured in played:
        fix, verdicts = rounds.solve(measured, height_m)
        assert [verdict.sensor_id for verdict in verdicts] == [item.anchor_id for item in measured]
        accepted = sum(verdict.accepted for verdict in verdicts)
        if fix.status is FixStatus.OK:
            assert accepted == fix.ranges_used
            assert np.isfinite(fix.position_m).all()
            assert is_covariance(fix.covariance_m2)
        else:
            assert accepted == 0
            assert np.isnan(fix.position_m).all()


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.lists(ANY_RANGE, max_size=8))
def test_after_any_round_good_ones_are_solved_again(seed, rubbish):
    """What one bad message does to a track is over within the stated time of re-opening."""
    rng, rounds = np.random.default_rng(seed), Rounds(solver())
    for _ in range(10):
        rounds.solve(noisy(rng))
    rounds.solve(rubbish)
    for _ in range(30):
        fix, verdicts = rounds.solve(noisy(rng))
    assert math.dist(fix.position_m, TAG) < 0.15
    assert set(reasons(verdicts)) == {Reason.ACCEPTED}


# Methods.


@pytest.mark.parametrize("method", RANGE_METHODS)
def test_another_method_begins_with_new_solvers(method):
    rounds = Rounds(solver(method="least_squares" if method != "least_squares" else "weighted_lm"))
    rounds.solve(ranges())
    rounds.subject.parameters = UwbSolverParameters(method=method)
    assert not rounds.subject._tags
    assert set(reasons(rounds.solve(ranges())[1])) == {Reason.ACCEPTED}
    ((_, tag),) = rounds.subject._tags.items()
    assert type(tag.solver) is type(RANGE_SOLVERS[method](rounds.subject.parameters))


def test_a_silence_of_thirty_seconds_starts_the_tracker_anew():
    rounds, rng = Rounds(solver()), np.random.default_rng(9)
    for _ in range(20):
        rounds.solve(noisy(rng))
    rounds.stamp_ns += 31 * NS_PER_S
    fix, verdicts = rounds.solve(ranges()[:1])
    assert fix.status is FixStatus.TOO_FEW_RANGES
    assert reasons(verdicts) == [Reason.NOT_INITIALISED]


# Blinks: only that each arrival is answered; what is made of them belongs to the solvers of blinks.


def test_every_arrival_of_a_blink_gets_a_verdict_of_its_source():
    subject = solver()
    arrivals = [replace(item, range_m=item.range_m - ranges()[0].range_m) for item in ranges()]
    arrivals += [MeasuredRange(2, 1.0, 0.01), MeasuredRange(99, 1.0, 0.01), MeasuredRange(4, math.nan, 0.01)]
    subject.intake.disabled.add(3)
    _, verdicts = subject.solve_blink(7, NOW_NS, NOW_NS, arrivals, 1.0)
    assert {verdict.source for verdict in verdicts} == {Source.TDOA}
    assert [verdict.sensor_id for verdict in verdicts] == [item.anchor_id for item in arrivals]
    assert reasons(verdicts)[2] is Reason.DISABLED
    assert reasons(verdicts)[-3:] == [Reason.DUPLICATE, Reason.UNKNOWN_SENSOR, Reason.DUPLICATE]


def test_blinks_and_rounds_of_a_tag_have_stamps_of_their_own():
    subject = solver()
    subject.solve(7, NOW_NS, NOW_NS, ranges(), 1.0)
    _, verdicts = subject.solve_blink(7, NOW_NS, NOW_NS, ranges(), 1.0)
    assert Reason.DUPLICATE not in reasons(verdicts)
