"""From a round to a position: every range gets its verdict, and only good ones are used."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_core.site import Anchor
from mine_loc_core.verdicts import Reason, Source
from mine_loc_uwb.fix import FixStatus
from mine_loc_uwb.parameters import UwbSolverParameters
from mine_loc_uwb.round_solver import MeasuredRange, RoundSolver

PLACES = {1: (0.0, 0.0, 2.4), 2: (60.0, 2.0, 2.4), 3: (58.0, 45.0, 2.4), 4: (1.0, 46.0, 2.4), 5: (30.0, 20.0, 2.4)}
TAG = (20.0, 12.0, 1.0)


def solver(places=None, offset_m=0.0):
    anchors = [Anchor(i, str(i), place, 0.0, offset_m) for i, place in (places or PLACES).items()]
    return RoundSolver(anchors, UwbSolverParameters())


def ranges(tag=TAG, places=None, noise=lambda: 0.0):
    places = places or PLACES
    return [MeasuredRange(i, math.dist(place, tag) + noise(), 0.01) for i, place in places.items()]


def reasons(verdicts):
    return [verdict.reason for verdict in verdicts]


def test_a_good_round_gives_a_position_and_accepts_each_range_in_order():
    fix, verdicts = solver().solve(7, ranges(), 1.0)
    assert fix.position_m == pytest.approx(TAG, abs=1e-6)
    assert [(v.source, v.sensor_id, v.reason) for v in verdicts] == [(Source.RANGE, i, Reason.ACCEPTED) for i in PLACES]
    assert [v.innovation for v in verdicts] == pytest.approx([0.0] * 5, abs=1e-6)


def test_an_anchors_range_offset_is_taken_off():
    late = [MeasuredRange(item.anchor_id, item.range_m + 0.8, 0.01) for item in ranges()]
    assert solver(offset_m=0.8).solve(7, late, 1.0)[0].position_m == pytest.approx(TAG, abs=1e-6)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 0.0, -3.0, 300.1, 1e300])
def test_an_impossible_range_is_invalid_and_not_used(value):
    bad = [*ranges()[:4], MeasuredRange(5, value, 0.01)]
    fix, verdicts = solver().solve(7, bad, 1.0)
    assert reasons(verdicts) == [Reason.ACCEPTED] * 4 + [Reason.INVALID]
    assert fix.position_m == pytest.approx(TAG, abs=1e-6)
    assert fix.ranges_used == 4


def test_an_anchor_that_the_site_does_not_know_is_told_and_not_used():
    fix, verdicts = solver().solve(7, [MeasuredRange(99, 3.0, 0.01), *ranges()], 1.0)
    assert reasons(verdicts) == [Reason.UNKNOWN_SENSOR] + [Reason.ACCEPTED] * 5
    assert fix.position_m == pytest.approx(TAG, abs=1e-6)


def test_a_disabled_anchor_is_left_out_until_it_is_enabled():
    subject = solver()
    subject.disabled.add(2)
    assert reasons(subject.solve(7, ranges(), 1.0)[1])[1] is Reason.DISABLED
    subject.disabled.clear()
    assert reasons(subject.solve(7, ranges(), 1.0)[1])[1] is Reason.ACCEPTED


def test_the_second_range_of_an_anchor_is_a_duplicate():
    fix, verdicts = solver().solve(7, [*ranges(), MeasuredRange(1, 5.0, 0.01)], 1.0)
    assert reasons(verdicts) == [Reason.ACCEPTED] * 5 + [Reason.DUPLICATE]
    assert fix.position_m == pytest.approx(TAG, abs=1e-6)


def test_a_good_range_after_a_failed_one_of_the_same_anchor_is_used():
    _, verdicts = solver().solve(7, [MeasuredRange(1, math.nan, 0.01), *ranges()], 1.0)
    assert reasons(verdicts) == [Reason.INVALID] + [Reason.ACCEPTED] * 5


def test_a_value_that_repeats_without_noise_is_frozen_and_thaws_when_it_moves():
    rng = np.random.default_rng(1)
    subject = solver()

    def play(stuck_m):
        round_ = ranges(noise=lambda: rng.normal(0, 0.02))
        return reasons(subject.solve(7, [MeasuredRange(1, stuck_m, 0.01), *round_[1:]], 1.0)[1])

    history = [play(23.0)[0] for _ in range(40)]
    assert history[:20] == [Reason.ACCEPTED] * 20
    assert history[20:] == [Reason.FROZEN] * 20
    assert play(23.5) == [Reason.ACCEPTED] * 5
    for _ in range(30):
        assert Reason.FROZEN not in play(23.0 + rng.normal(0, 0.02))


def test_duplicates_within_a_round_do_not_count_as_repeats():
    subject, rng = solver(), np.random.default_rng(2)
    for _ in range(30):
        once = ranges(noise=lambda: rng.normal(0, 0.02))
        assert Reason.FROZEN not in reasons(subject.solve(7, once * 5, 1.0)[1])


def test_tags_are_judged_apart_and_a_forgotten_tag_starts_anew():
    subject = solver()
    for _ in range(25):
        subject.solve(7, ranges(), 1.0)
    assert set(reasons(subject.solve(8, ranges(), 1.0)[1])) == {Reason.ACCEPTED}
    assert set(reasons(subject.solve(7, ranges(), 1.0)[1])) == {Reason.FROZEN}
    subject.forget(7)
    assert set(reasons(subject.solve(7, ranges(), 1.0)[1])) == {Reason.ACCEPTED}


@pytest.mark.parametrize("used", [0, 2])
def test_ranges_that_do_not_determine_a_position_are_not_called_accepted(used):
    fix, verdicts = solver().solve(7, ranges()[:used], 1.0)
    assert fix.status is FixStatus.TOO_FEW_RANGES
    assert reasons(verdicts) == [Reason.DEGENERATE] * used


def test_all_anchors_on_a_line_give_no_position_and_say_why():
    places = {i: (10.0 * i, 5.0, 2.4) for i in range(1, 7)}
    fix, verdicts = solver(places).solve(7, ranges(places=places), 1.0)
    assert fix.status is FixStatus.DEGENERATE
    assert set(reasons(verdicts)) == {Reason.DEGENERATE}


def test_an_outlier_of_minus_45_m_is_refused_or_makes_the_claimed_area_wide():
    near, far = ranges(), ranges(tag=(2.0, 3.0, 1.0))
    near[4] = MeasuredRange(5, near[4].range_m - 45.0, 0.01)
    assert reasons(solver().solve(7, near, 1.0)[1])[4] is Reason.INVALID
    far[2] = MeasuredRange(3, far[2].range_m - 45.0, 0.01)
    fix, _ = solver().solve(7, far, 1.0)
    clean, _ = solver().solve(7, ranges(tag=(2.0, 3.0, 1.0)), 1.0)
    error_m = math.dist(fix.position_m, (2.0, 3.0, 1.0))
    claimed_m, clean_m = (math.sqrt(np.trace(covariance)) for covariance in (fix.covariance_m2, clean.covariance_m2))
    assert claimed_m > max(50 * clean_m, error_m / 2)
    assert fix.residual_rms_m > 1.0


@pytest.mark.parametrize("variance", [0.0, math.nan, math.inf, -1.0])
def test_an_unusable_variance_does_not_reach_the_covariance(variance):
    odd = [MeasuredRange(item.anchor_id, item.range_m, variance) for item in ranges()]
    fix, _ = solver().solve(7, odd, 1.0)
    assert np.isfinite(fix.covariance_m2).all()
    assert 0.0 < fix.covariance_m2[0, 0] < 1.0


NUMBER = st.floats() | st.floats(-1.0, 400.0)


@settings(max_examples=100, deadline=None)
@given(
    st.dictionaries(st.integers(1, 8), st.tuples(*[st.floats(-500.0, 500.0)] * 3), max_size=8),
    st.lists(st.builds(MeasuredRange, st.integers(0, 10), NUMBER, NUMBER), max_size=12),
    st.none() | st.floats(-5.0, 5.0),
)
def test_any_round_on_any_anchors_gives_a_finite_position_or_says_why_not(places, measured, height_m):
    fix, verdicts = RoundSolver(
        [Anchor(i, str(i), place, 0.0, 0.0) for i, place in places.items()], UwbSolverParameters()
    ).solve(7, measured, height_m)
    assert len(verdicts) == len(measured)
    accepted = sum(verdict.accepted for verdict in verdicts)
    if fix.status is FixStatus.OK:
        assert accepted == fix.ranges_used
        assert np.isfinite(fix.position_m).all()
        assert np.isfinite(fix.covariance_m2).all()
        assert np.linalg.eigvalsh(fix.covariance_m2)[0] >= -1e-9 * np.abs(fix.covariance_m2).max()
    else:
        assert accepted == 0
        assert np.isnan(fix.position_m).all()
