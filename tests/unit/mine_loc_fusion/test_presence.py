"""Hysteresis and dwell, against what their rule says in words, for any course of probabilities."""

import itertools

from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.stamps import NS_PER_S
from mine_loc_fusion.presence import Presence, PresenceRule

RULE = PresenceRule(enter=0.5, leave=0.1, enter_dwell_s=1.0, leave_dwell_s=2.0)
courses = st.lists(st.tuples(st.integers(1, 15), st.sampled_from([0.0, 0.1, 0.3, 0.5, 1.0])), max_size=40)


def run(course, rule=RULE):
    """(stamp in s, probability, inside, changed) of each update; steps are tenths of a second."""
    presence, at, seen = Presence(rule), 0, []
    for step, probability in course:
        at += step
        changed = presence.update(at * NS_PER_S // 10, probability)
        seen.append((at / 10, probability, presence.inside, changed))
    return seen


@given(courses)
def test_it_changes_exactly_when_the_bound_has_held_for_the_dwell(course):
    seen = run(course)
    inside, changed_at = False, -1
    for number, (at, probability, now_inside, changed) in enumerate(seen):
        bound = (lambda p: p <= RULE.leave) if inside else (lambda p: p >= RULE.enter)
        dwell = RULE.leave_dwell_s if inside else RULE.enter_dwell_s
        held_from = at
        for earlier in range(number, changed_at, -1):
            if not bound(seen[earlier][1]):
                break
            held_from = seen[earlier][0]
        expected = bound(probability) and at - held_from >= dwell - 1e-9
        assert changed == expected
        if expected:
            inside, changed_at = not inside, number
        assert now_inside == inside


@given(courses)
def test_between_the_bounds_nothing_ever_changes(course):
    assert not any(changed for _, p, _, changed in run(course) if RULE.leave < p < RULE.enter)


@given(courses)
def test_a_state_lasts_at_least_its_dwell(course):
    changes = [(at, inside) for at, _, inside, changed in run(course) if changed]
    for (began, inside), (ended, _) in itertools.pairwise(changes):
        assert ended - began >= (RULE.leave_dwell_s if inside else RULE.enter_dwell_s) - 1e-9


def test_without_dwell_the_first_probability_past_the_bound_counts():
    presence = Presence(PresenceRule(0.5, 0.1, 0.0, 0.0))
    assert presence.update(7, 0.5)
    assert (presence.inside, presence.since_ns) == (True, 7)


def test_time_that_was_set_back_or_jumped_lets_the_count_begin_anew():
    presence = Presence(RULE)
    presence.update(100 * NS_PER_S, 1.0)
    assert not presence.update(10 * NS_PER_S, 1.0)
    assert not presence.update(10 * NS_PER_S + 900_000_000, 1.0)
    presence.time_jumped()
    assert not presence.update(11 * NS_PER_S, 1.0)
    assert presence.update(12 * NS_PER_S, 1.0)
