"""Time alignment: in order, each input used exactly once, never waiting for what is slow."""

import itertools
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_core.verdicts import Reason
from mine_loc_fusion.synchroniser import CAPACITY, Kind, Synchroniser, SyncInput

T0 = 1_760_000_000 * NS_PER_S
WAIT_NS = 8 * NS_PER_MS
HISTORY_NS = 2 * NS_PER_S
FUTURE_NS = 50 * NS_PER_MS
EPOCH_MSG = Path(__file__).parents[3] / "src/mine_loc_interfaces/msg/Epoch.msg"


def synchroniser(**options):
    limits = {"companion_wait_ns": WAIT_NS, "history_ns": HISTORY_NS, "future_ns": FUTURE_NS, "max_open": 64}
    return Synchroniser(**(limits | options))


def item(kind, ms, *, source=0, seq=0, links=0, payload=None, person="ann"):
    return SyncInput(person, kind, source, seq, T0 + ms * NS_PER_MS, payload or (kind, source, seq, ms), links)


def at(ms):
    return T0 + ms * NS_PER_MS


def test_a_round_goes_out_as_soon_as_its_position_is_there():
    subject = synchroniser()
    assert subject.push(item(Kind.RANGES, 0), at(3)) == ([], Reason.ACCEPTED)
    epochs, _ = subject.push(item(Kind.UWB_POSE, 0), at(4))
    assert [(e.stamp_ns, e.late, set(e.inputs)) for e in epochs] == [(T0, False, {Kind.RANGES, Kind.UWB_POSE})]
    assert subject.next_deadline_ns is None


def test_a_round_without_companions_goes_out_when_the_wait_is_over():
    subject = synchroniser()
    subject.push(item(Kind.RANGES, 0), at(3))
    subject.push(item(Kind.RANGES, 1, person="bob"), at(5))
    assert subject.next_deadline_ns == at(11)
    assert subject.poll(at(11) - 1) == []
    assert [(e.person, set(e.inputs)) for e in subject.poll(at(11))] == [("ann", {Kind.RANGES})]
    assert subject.next_deadline_ns == at(13)


def test_link_states_are_waited_for_while_they_are_known_to_come_and_no_longer():
    subject = synchroniser()
    subject.push(item(Kind.LINK_STATE, 0, source=1), at(1))
    subject.push(item(Kind.RANGES, 0, links=2), at(2))
    assert subject.push(item(Kind.UWB_POSE, 0), at(3))[0] == []
    (epoch,), _ = subject.push(item(Kind.LINK_STATE, 0, source=2), at(4))
    assert len(epoch.inputs[Kind.LINK_STATE]) == 2
    subject.push(item(Kind.RANGES, 5000, seq=1, links=2), at(5001))
    assert len(subject.push(item(Kind.UWB_POSE, 5000, seq=1), at(5002))[0]) == 1


def test_a_round_whose_links_are_judged_does_not_wait_for_its_position():
    subject = synchroniser()
    subject.push(item(Kind.LINK_STATE, 0, source=1), at(1))
    subject.push(item(Kind.RANGES, 0, links=1), at(2))
    subject.push(item(Kind.RANGES, 100, seq=1, links=1), at(102))
    (epoch,), _ = subject.push(item(Kind.LINK_STATE, 100, source=1, seq=1), at(103))
    assert set(epoch.inputs) == {Kind.RANGES, Kind.LINK_STATE}
    subject.push(item(Kind.UWB_POSE, 100, seq=1), at(104))
    (late,) = subject.poll(at(112))
    assert (late.late, set(late.inputs)) == (True, {Kind.UWB_POSE})
    assert subject.next_deadline_ns is None


def test_a_change_of_velocity_does_not_take_a_round_along_that_waits_for_its_links():
    subject = synchroniser()
    subject.push(item(Kind.LINK_STATE, 0, source=1), at(1))
    subject.push(item(Kind.RANGES, 0, links=2), at(2))
    assert subject.push(item(Kind.VELOCITY_CHANGE, 3), at(4)) == ([], Reason.ACCEPTED)
    (epoch,), _ = subject.push(item(Kind.LINK_STATE, 0, source=2), at(5))
    assert set(epoch.inputs) == {Kind.RANGES, Kind.LINK_STATE}
    (change,) = subject.poll(at(12))
    assert (change.stamp_ns, change.late, set(change.inputs)) == (at(3), False, {Kind.VELOCITY_CHANGE})


def test_those_who_wait_are_polled_until_their_time_is_over_and_forgotten_with_a_reset():
    subject = synchroniser()
    for person in ("ann", "bob"):
        subject.push(item(Kind.RANGES, 0, person=person), at(0))
    assert [epoch.person for epoch in subject.poll(at(8))] == ["ann", "bob"]
    assert subject.next_deadline_ns is None
    subject.push(item(Kind.RANGES, 100, seq=1, person="ann"), at(100))
    subject.push(item(Kind.RANGES, 100, seq=1, person="bob"), at(100))
    subject.forget("ann")
    assert subject.next_deadline_ns == at(108)
    subject.reset()
    assert subject.next_deadline_ns is None
    assert subject.poll(at(200)) == []


def test_a_step_is_not_waited_for_and_comes_in_an_epoch_marked_late():
    subject = synchroniser()
    subject.push(item(Kind.RANGES, 400), at(400))
    (on_time,), _ = subject.push(item(Kind.UWB_POSE, 400), at(401))
    (late,), reason = subject.push(item(Kind.STEP, 100), at(402))
    assert reason is Reason.ACCEPTED
    assert (on_time.late, late.late, late.stamp_ns) == (False, True, at(100))
    assert (on_time.seq, late.seq, subject.late) == (1, 2, 1)


@pytest.mark.parametrize(
    ("second", "now_ms", "reason"),
    [
        (item(Kind.RANGES, 5000, seq=1), 5001, Reason.DUPLICATE),
        (item(Kind.RANGES, 4900, seq=0), 5001, Reason.BACKWARD),
        (item(Kind.STEP, 2990), 5001, Reason.STALE),
        (item(Kind.RANGES, 5100, seq=2), 5040, Reason.FUTURE),
    ],
)
def test_a_refused_input_is_counted_under_its_reason_and_nothing_else(second, now_ms, reason):
    subject = synchroniser()
    subject.push(item(Kind.RANGES, 5000, seq=1), at(5000))
    subject.poll(at(5010))
    assert subject.push(second, at(now_ms))[1] is reason
    assert subject.refused == Counter({reason: 1})
    assert subject.used == 1


def test_an_epoch_takes_no_more_of_a_kind_than_its_message_holds():
    bounds = {name: int(bound) for bound, name in re.findall(r"\[<=(\d+)\] (\w+)", EPOCH_MSG.read_text("utf-8"))}
    assert {kind.value: capacity for kind, capacity in CAPACITY.items()} == bounds
    subject = synchroniser()
    for i in range(100):
        subject.push(item(Kind.LINK_STATE, 0, source=i), at(1))
    (epoch,) = subject.poll(at(20))
    assert len(epoch.inputs[Kind.LINK_STATE]) == 64
    assert subject.refused == Counter({Reason.OVERFLOW: 36})


def test_more_open_epochs_than_allowed_push_the_oldest_out():
    subject = synchroniser(max_open=3)
    out = [epoch for i in range(5) for epoch in subject.push(item(Kind.RANGES, i, seq=i), at(5))[0]]
    assert [epoch.stamp_ns for epoch in out] == [at(0), at(1)]


@pytest.mark.parametrize("jump_s", [-3600, 3600])
def test_after_a_jump_of_time_and_a_reset_the_stream_goes_on_and_the_count_with_it(jump_s):
    subject = synchroniser()
    subject.push(item(Kind.RANGES, 0), at(0))
    subject.poll(at(10))
    subject.push(item(Kind.RANGES, 100, seq=1), at(100))
    subject.reset()
    assert (subject.used, subject.refused) == (1, Counter({Reason.OVERFLOW: 1}))
    later_ms = 200 + 1000 * jump_s
    subject.push(item(Kind.RANGES, later_ms, seq=2), at(later_ms))
    (epoch,) = subject.poll(at(later_ms + 10))
    assert (epoch.seq, epoch.late) == (2, False)


def test_a_reset_with_nothing_open_counts_nothing():
    subject = synchroniser()
    subject.push(item(Kind.STEP, 0), at(0))
    subject.reset()
    assert not subject.refused


def test_people_do_not_wait_for_each_other():
    subject = synchroniser()
    subject.push(item(Kind.RANGES, 0), at(0))
    (epoch,), _ = subject.push(item(Kind.STEP, 50, person="bob"), at(1))
    assert (epoch.person, epoch.late) == ("bob", False)


@dataclass(frozen=True)
class Arrival:
    now_ns: int
    input: SyncInput


@st.composite
def traffic(draw):
    """Rounds with poses and link states, and steps: delayed, reordered, dropped, doubled."""
    arrivals = []
    for i in range(draw(st.integers(1, 25))):
        made = [item(Kind.RANGES, 66 * i, seq=i, links=2), item(Kind.UWB_POSE, 66 * i, seq=i)]
        made += [item(Kind.LINK_STATE, 66 * i, source=k, seq=i) for k in range(2)]
        made += [item(Kind.STEP, 66 * i - 3, seq=i)] if i % 8 == 0 else []
        for one in made:
            delays_ms = draw(st.lists(st.integers(-80, 3000) | st.integers(0, 12), max_size=2))
            arrivals += [Arrival(one.stamp_ns + delay_ms * NS_PER_MS, one) for delay_ms in delays_ms]
    return sorted(arrivals, key=lambda a: a.now_ns)


def play(arrivals, subject):
    """(arrivals with their reason, epochs with the time they went out)."""
    taken, out = [], []
    for number, arrival in enumerate(arrivals):
        previous_ns = arrivals[number - 1].now_ns if number else arrival.now_ns
        for now_ns in range(previous_ns, min(arrival.now_ns, previous_ns + 2 * WAIT_NS), NS_PER_MS):
            out += [(now_ns, epoch) for epoch in subject.poll(now_ns)]
        epochs, reason = subject.push(arrival.input, arrival.now_ns)
        taken.append((arrival, reason))
        out += [(arrival.now_ns, epoch) for epoch in epochs]
    end_ns = arrivals[-1].now_ns if arrivals else T0
    polls_ns = range(end_ns, end_ns + 2 * WAIT_NS, NS_PER_MS)
    return taken, out + [(now_ns, epoch) for now_ns in polls_ns for epoch in subject.poll(now_ns)]


@settings(max_examples=60)
@given(traffic())
def test_every_input_is_used_once_or_refused_and_epochs_that_are_not_late_go_forward(arrivals):
    subject = synchroniser()
    taken, out = play(arrivals, subject)
    accepted = [arrival for arrival, reason in taken if reason is Reason.ACCEPTED]
    emitted = [payload for _, epoch in out for payloads in epoch.inputs.values() for payload in payloads]
    assert Counter(emitted) == Counter(arrival.input.payload for arrival in accepted)
    assert max(Counter(emitted).values(), default=0) <= 1
    assert subject.refused == Counter(reason for _, reason in taken if reason is not Reason.ACCEPTED)
    assert subject.used == len(emitted)

    on_time = [epoch.stamp_ns for _, epoch in out if not epoch.late]
    assert all(a < b for a, b in itertools.pairwise(on_time))
    assert [epoch.seq for _, epoch in out] == list(range(1, len(out) + 1))
    newest = 0
    for _, epoch in out:
        assert epoch.late == (epoch.stamp_ns <= newest)
        newest = max(newest, epoch.stamp_ns)
    assert subject.next_deadline_ns is None

    out_at = {payload: now_ns for now_ns, epoch in out for payloads in epoch.inputs.values() for payload in payloads}
    assert all(out_at[a.input.payload] - a.now_ns <= WAIT_NS + NS_PER_MS for a in accepted)


@settings(max_examples=20)
@given(traffic())
def test_the_same_arrivals_give_the_same_epochs(arrivals):
    assert play(arrivals, synchroniser()) == play(arrivals, synchroniser())


def test_memory_is_bounded_and_what_is_forgotten_is_not_used_twice():
    subject = synchroniser(max_open=10**6)
    hostile = [item(Kind.LINK_STATE, i % 40, source=2**40 + i) for i in range(20_000)]
    seen = Counter()
    for one in hostile + hostile:
        epochs, _ = subject.push(one, at(41))
        epochs += subject.poll(at(60))
        seen.update(payload for epoch in epochs for payloads in epoch.inputs.values() for payload in payloads)
    assert max(seen.values()) == 1
    for i in range(20_000):
        subject.push(item(Kind.RANGES, 100, source=2**40 + i), at(100))
        subject.poll(at(120))
    person = subject._people["ann"]
    assert len(person.seen) < 10_000
    assert len(person.newest_of_source) < 1000
