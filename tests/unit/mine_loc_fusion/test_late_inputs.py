"""Late inputs: the result is that of the order they should have come in."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from walks import place_fix, ranges_to

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_core.verdicts import Reason, Source
from mine_loc_fusion.ekf import Ekf
from mine_loc_fusion.estimate import EpochInputs, PositionFix, StepFix
from mine_loc_fusion.late_inputs import LateInputCorrector
from mine_loc_fusion.tightly_coupled import TightlyCoupled

T0 = 1_760_000_000 * NS_PER_S
HISTORY_NS = 2 * NS_PER_S


def corrector():
    return LateInputCorrector(Ekf(), HISTORY_NS)


def walk(count, period_ms=100):
    """Somebody walks east at 1.2 m/s: a position an epoch, and a step in an epoch of its own after every fifth."""
    rng = np.random.default_rng(3)
    epochs = []
    for i in range(count):
        position = np.array([0.12 * i, 0.0]) + rng.normal(0.0, 0.1, 2)
        epochs.append(EpochInputs(T0 + i * period_ms * NS_PER_MS, positions=(PositionFix(position, np.eye(2) * 0.01),)))
        if i % 5 == 4:
            step = StepFix(0.6, 0.003, 0.5, 0.01, 0.5)
            epochs.append(EpochInputs(T0 + (i * period_ms + 40) * NS_PER_MS, steps=(step,)))
    return epochs


def result(epochs):
    subject = corrector()
    for epoch in epochs:
        subject.update(epoch)
    return subject.estimate(max(epoch.stamp_ns for epoch in epochs))


def assert_same(a, b):
    assert np.array_equal(a.position_m, b.position_m)
    assert np.array_equal(a.velocity_ms, b.velocity_ms)
    assert np.array_equal(a.covariance, b.covariance)
    assert replace(a, position_m=0, velocity_ms=0, covariance=0) == replace(
        b, position_m=0, velocity_ms=0, covariance=0
    )


@settings(max_examples=40)
@given(st.data())
def test_any_order_within_the_history_gives_exactly_the_result_of_the_right_order(data):
    epochs = walk(60)
    delays = data.draw(st.lists(st.integers(0, 1900), min_size=len(epochs), max_size=len(epochs)))
    arrived = [e for _, e in sorted(zip(delays, epochs, strict=True), key=lambda p: p[1].stamp_ns + p[0] * NS_PER_MS)]
    assert_same(result(arrived), result(epochs))


def test_a_late_step_counts_even_where_epochs_are_rare():
    epochs = walk(10, period_ms=3000)
    late = epochs.copy()
    step = next(i for i, epoch in enumerate(late) if epoch.steps and i > 0)
    before = late.pop(step)
    moved = replace(late[step], stamp_ns=before.stamp_ns + 400 * NS_PER_MS)
    in_order = [*late[:step], before, moved]
    assert_same(result([*late[:step], moved, before]), result(in_order))


def test_beyond_the_history_every_measurement_is_stale_and_nothing_changes():
    subject = corrector()
    for epoch in walk(60):
        subject.update(epoch)
    end_ns = T0 + 6 * NS_PER_S
    before = subject.estimate(end_ns)
    old = EpochInputs(
        T0 + 3 * NS_PER_S, (PositionFix(np.array([50.0, 50.0]), np.eye(2)),), (StepFix(0.6, 0.003, 0.0, 0.01, 0.5),)
    )
    verdicts = subject.update(old)
    assert [(v.source, v.reason) for v in verdicts] == [
        (Source.UWB_POSE, Reason.STALE),
        (Source.STEP, Reason.STALE),
    ]
    assert_same(subject.estimate(end_ns), before)


def test_the_history_does_not_grow_for_ever():
    subject = corrector()
    for epoch in walk(300):
        subject.update(epoch)
    assert len(subject._history) < 30


def test_beyond_the_history_ranges_blinks_and_places_are_stale_under_their_own_names():
    subject = LateInputCorrector(TightlyCoupled(), HISTORY_NS)
    subject.update(EpochInputs(T0, ranges=(ranges_to((8.0, 6.0), T0),)))
    before = subject.estimate(T0)
    old_ns = T0 - HISTORY_NS - 1
    ranges = ranges_to((9.0, 9.0), old_ns)
    blink = replace(ranges, shared_offset=True)
    places = (place_fix(9.0, 9.0), place_fix(9.0, 9.0, source=Source.REGION))
    verdicts = subject.update(EpochInputs(old_ns, ranges=(ranges, blink), places=places))
    assert {v.reason for v in verdicts} == {Reason.STALE}
    assert [v.source for v in verdicts] == [Source.RANGE, Source.TDOA, Source.LANDMARK, Source.REGION]
    assert_same(subject.estimate(T0), before)
    on_time = subject.update(EpochInputs(T0 - HISTORY_NS, places=places[:1]))
    assert Reason.STALE not in {v.reason for v in on_time}


def test_who_begins_anew_has_no_history_to_go_back_to():
    subject = corrector()
    for epoch in walk(20):
        subject.update(epoch)
    subject.begin(T0 + NS_PER_S, np.array([70.0, 0.0]), 0.01 * np.eye(2), None)
    subject.update(EpochInputs(T0 + NS_PER_S))
    subject.update(EpochInputs(T0 + NS_PER_S // 2))  # late: goes back no farther than the new beginning
    assert subject.estimate(T0 + NS_PER_S).position_m.tolist() == [70.0, 0.0]
