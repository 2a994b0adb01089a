"""What the round solver keeps of its tags: instants, judgements of links, and no more than it must."""

import math
from dataclasses import replace

import numpy as np
import pytest
from uwb_rounds import NOW_NS, PLACES, Rounds, noisy, ranges, reasons, solver

from mine_loc_core.stamps import NS_PER_S
from mine_loc_core.verdicts import Reason
from mine_loc_uwb import range_intake, round_solver
from mine_loc_uwb.parameters import RANGE_METHODS
from mine_loc_uwb.range_intake import MeasuredRange

# Stamps.


def test_a_stamp_from_the_future_is_refused_and_does_not_lock_out_the_next_good_round():
    subject = solver()
    fix, verdicts = subject.solve(7, NOW_NS + 10 * NS_PER_S, NOW_NS, ranges(), 1.0)
    assert set(reasons(verdicts)) == {Reason.FUTURE}
    assert fix is None
    assert set(reasons(subject.solve(7, NOW_NS, NOW_NS, ranges(), 1.0)[1])) == {Reason.ACCEPTED}


@pytest.mark.parametrize("method", RANGE_METHODS)
@pytest.mark.parametrize(
    ("later_ns", "reason"), [(0, Reason.DUPLICATE), (-1, Reason.BACKWARD), (-NOW_NS, Reason.BACKWARD)]
)
def test_a_repeated_or_backward_stamp_is_refused_and_changes_nothing(method, later_ns, reason):
    subjects = [solver(method=method) for _ in range(2)]
    for subject in subjects:
        subject.solve(7, NOW_NS, NOW_NS, ranges(), 1.0)
    fix, verdicts = subjects[0].solve(7, NOW_NS + later_ns, NOW_NS, ranges(tag=(50.0, 40.0, 1.0)), 1.0)
    assert set(reasons(verdicts)) == {reason}
    assert fix is None
    untroubled, troubled = (s.solve(7, NOW_NS + 10**8, NOW_NS + 10**8, ranges(), 1.0)[0] for s in subjects)
    assert troubled.position_m.tolist() == untroubled.position_m.tolist()


def test_rounds_that_come_late_are_as_good_as_prompt_ones():
    subject, rng = solver(), np.random.default_rng(4)
    for number in range(10):
        stamp_ns = NOW_NS + number * NS_PER_S // 10
        _, verdicts = subject.solve(7, stamp_ns, stamp_ns + 3 * NS_PER_S, noisy(rng), 1.0)
        assert set(reasons(verdicts)) == {Reason.ACCEPTED}


def test_stamps_of_different_tags_have_nothing_to_do_with_each_other():
    subject = solver()
    subject.solve(7, NOW_NS, NOW_NS, ranges(), 1.0)
    assert set(reasons(subject.solve(8, NOW_NS - NS_PER_S, NOW_NS, ranges(), 1.0)[1])) == {Reason.ACCEPTED}


def test_after_a_reset_earlier_stamps_are_good_again():
    subject = solver()
    subject.solve(7, NOW_NS, NOW_NS, ranges(), 1.0)
    subject.reset()
    assert set(reasons(subject.solve(7, NOW_NS // 2, NOW_NS // 2, ranges(), 1.0)[1])) == {Reason.ACCEPTED}


@pytest.mark.parametrize("since_ns", [2 * NS_PER_S, -2 * NS_PER_S, 2**63 - 1, -(2**63)])
def test_an_exchange_that_cannot_belong_to_its_round_is_invalid(since_ns):
    measured = ranges()
    measured[0] = replace(measured[0], since_ns=since_ns)
    assert reasons(Rounds(solver()).solve(measured)[1]) == [Reason.INVALID] + [Reason.ACCEPTED] * 4


def test_a_range_counts_at_its_own_instant():
    """A walker of 2 m/s whose exchanges are spread over 0.1 s: taken at the stamp, ranges would be 10 cm off."""
    rng, errors = np.random.default_rng(5), {True: [], False: []}
    for told in (True, False):
        rounds = Rounds(solver())
        for number in range(100):
            measured = []
            for place, (anchor, at) in enumerate(PLACES.items()):
                since_s = 0.025 * place
                walker = (10.0 + 2.0 * (0.1 * number + since_s), 12.0, 1.0)
                range_m = math.dist(at, walker) + rng.normal(0, 0.01)
                measured.append(MeasuredRange(anchor, range_m, 1e-4, round(since_s * NS_PER_S) if told else 0))
            fix, _ = rounds.solve(measured)
            errors[told].append(math.dist(fix.position_m, (10.0 + 0.2 * number, 12.0, 1.0)))
    assert np.mean(errors[True][50:]) < 0.6 * np.mean(errors[False][50:])


# Link states.


def pull_m(told, rule=math.nan):
    """How far a range that is 0.4 m late draws the fix, after these judgements of its link."""
    fixes = []
    for late_m in (0.0, 0.4):
        rng, rounds = np.random.default_rng(6), Rounds(solver())
        for _ in range(10):
            rounds.solve(noisy(rng))
        for probability, ago_ns in told:
            rounds.subject.intake.link_state(7, 1, rounds.stamp_ns + NS_PER_S // 10 - ago_ns, probability)
        measured = noisy(rng)
        measured[0] = MeasuredRange(1, measured[0].range_m + late_m, 0.01, los_probability=rule)
        fixes.append(rounds.solve(measured)[0].position_m)
    return math.dist(*fixes)


def test_a_link_told_to_be_obstructed_pulls_less_than_one_told_to_be_clear():
    assert 0.0 < 2.0 * pull_m([(0.02, 0)]) < pull_m([(0.98, 0)])


def test_a_judgement_of_more_than_a_second_ago_is_forgotten():
    assert pull_m([(0.02, 2 * NS_PER_S)]) == pull_m([])


def test_the_classifier_counts_before_the_powers_and_the_powers_where_it_is_silent():
    assert pull_m([(0.02, 0)], rule=1.0) == pull_m([(0.02, 0)])
    assert pull_m([(math.nan, 0)], rule=0.0) == pull_m([], rule=0.0) < pull_m([], rule=1.0)


@pytest.mark.parametrize("probability", [-0.5, 1.5, math.inf, -math.inf, math.nan])
def test_what_is_no_probability_is_no_judgement(probability):
    assert pull_m([(probability, 0)]) == pull_m([])
    assert pull_m([], rule=probability) == pull_m([])


# Many tags.


def test_the_tag_heard_longest_ago_makes_room_when_there_are_too_many(monkeypatch):
    monkeypatch.setattr(round_solver, "MOST_TAGS", 5)
    monkeypatch.setattr(range_intake, "MOST_TAGS", 5)
    rounds = Rounds(solver(method="least_squares"))
    for tag in range(1, 6):
        rounds.solve(ranges(), tag=tag)
    rounds.solve(ranges(), tag=1)
    rounds.solve(ranges(), tag=99)
    assert sorted(tag for tag, _ in rounds.subject._tags) == [1, 3, 4, 5, 99]
    assert sorted(tag for tag, _ in rounds.subject.intake._repeated) == [1, 3, 4, 5, 99]


def test_memory_of_link_states_is_bounded_and_never_locks_a_tag_out(monkeypatch):
    monkeypatch.setattr(range_intake, "MOST_TAGS", 5)
    subject = solver()
    for tag in range(1, 20):
        subject.intake.link_state(tag, 1, NOW_NS, 0.3)
    assert sorted(subject.intake._link_states) == [15, 16, 17, 18, 19]
    subject.intake.link_state(15, 1, NOW_NS, 0.9)
    assert subject.intake._link_states[15][1][0] == 0.9
    subject.intake.link_state(15, 999, NOW_NS, 0.9)
    assert 999 not in subject.intake._link_states[15]


def test_nothing_is_kept_of_a_forgotten_tag():
    rounds = Rounds(solver())
    rounds.solve(ranges())
    rounds.subject.solve_blink(7, rounds.stamp_ns, rounds.stamp_ns, ranges(), 1.0)
    rounds.subject.intake.link_state(7, 1, NOW_NS, 0.3)
    rounds.subject.forget(7)
    assert not rounds.subject._tags
    assert not rounds.subject.intake._repeated
    assert not rounds.subject.intake._link_states


def test_a_hundred_tags_are_tracked_side_by_side():
    rounds, rng = Rounds(solver()), np.random.default_rng(8)
    places = {tag: (*rng.uniform([5, 5], [55, 40]), 1.0) for tag in range(1, 101)}
    for _ in range(3):
        for tag, place in places.items():
            rounds.stamp_ns += NS_PER_S // 1000
            fix, _ = rounds.subject.solve(tag, rounds.stamp_ns, rounds.stamp_ns, noisy(rng, tag=place), 1.0)
            assert math.dist(fix.position_m, place) < 0.25
