"""One person under fusion: output stamps never go back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from walks import HALL, place_fix, position_fix, ranges_to, step_fix

from mine_loc_core.people import Person, Stride
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_core.verdicts import Reason, Source
from mine_loc_fusion.estimate import EpochInputs, PositionFix
from mine_loc_fusion.mode import Mode
from mine_loc_fusion.parameters import FusionParameters
from mine_loc_fusion.tracked_person import TrackedPerson

T0 = 1_760_000_000 * NS_PER_S


def tracked():
    return TrackedPerson(Person("ann", 1, 1.7, None, Stride(), None), FusionParameters())


def epoch(ms, x=0.0):
    return EpochInputs(T0 + ms * NS_PER_MS, (PositionFix(np.array([x, 0.0]), np.eye(2) * 0.01),))


@settings(max_examples=50)
@given(st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 10_000)), min_size=1, max_size=30))
def test_outputs_never_go_back_whatever_comes_when(events):
    subject, last_ns = tracked(), 0
    for epoch_ms, output_ms in events:
        subject.update(epoch(epoch_ms), late=False)
        output = subject.output(T0 + output_ms * NS_PER_MS)
        assert output.stamp_ns >= max(last_ns, T0 + output_ms * NS_PER_MS)
        last_ns = output.stamp_ns
    assert subject.published_ns == last_ns


def test_before_the_first_position_nothing_is_put_out_and_the_mode_is_initialising():
    assert tracked().output(T0) is None
    assert tracked().mode(T0) is Mode.INITIALISING


def test_epochs_verdicts_and_innovations_are_counted():
    subject = tracked()
    for ms in range(0, 3000, 100):
        subject.update(epoch(ms), late=False)
    subject.update(epoch(2950, x=100.0), late=True)
    assert (subject.epochs, subject.late_epochs) == (31, 1)
    assert subject.reasons == {Reason.ACCEPTED: 30, Reason.GATE: 1}
    assert np.isfinite(subject.nis)


def test_a_reset_forgets_the_estimate_and_keeps_the_statistics():
    subject = tracked()
    subject.update(epoch(0), late=False)
    assert subject.output(T0).position_m == pytest.approx([0, 0])
    subject.reset()
    assert subject.output(T0) is None
    assert subject.epochs == 1
    assert np.isnan(tracked().nis)


# Switching kinds of measurement off, beginning at a place, regions.


def round_at(ms, place_m=(8.0, 6.0)):
    return EpochInputs(T0 + ms * NS_PER_MS, ranges=(ranges_to(place_m, T0 + ms * NS_PER_MS),))


def region(x=8.0, y=6.0, sd_m=5.0):
    return place_fix(x, y, sd_m, Source.REGION)


@pytest.mark.parametrize("source", [Source.RANGE, Source.UWB_POSE, Source.STEP, Source.LANDMARK, Source.REGION])
def test_a_kind_that_is_switched_off_is_told_disabled_and_not_used_until_it_is_on_again(source):
    subject, kinds = tracked(), {
        Source.RANGE: {"ranges": (ranges_to((8.0, 6.0), T0),)},
        Source.UWB_POSE: {"positions": (position_fix(8.0, 6.0),)},
        Source.STEP: {"steps": (step_fix(),)},
        Source.LANDMARK: {"places": (place_fix(8.0, 6.0),)},
        Source.REGION: {"places": (region(),)},
    }  # fmt: skip
    subject.disabled.add(source)
    (verdict,) = subject.update(EpochInputs(T0, **kinds[source]), late=False)
    assert (verdict.source, verdict.reason) == (source, Reason.DISABLED)
    assert subject.output(T0) is None
    assert subject.reasons == {Reason.DISABLED: 1}
    subject.disabled.discard(source)
    reason = Reason.NOT_INITIALISED if source is Source.STEP else Reason.ACCEPTED
    assert {v.reason for v in subject.update(EpochInputs(T0, **kinds[source]), late=False)} == {reason}


def test_what_is_not_switched_off_is_used_beside_it():
    subject = tracked()
    subject.disabled.add(Source.UWB_POSE)
    both = EpochInputs(T0, (position_fix(50.0, 50.0),), ranges=(ranges_to((8.0, 6.0), T0),))
    assert [v.reason for v in subject.update(both, late=False)] == [Reason.DISABLED] + [Reason.ACCEPTED] * len(HALL)
    assert subject.output(T0).position_m == pytest.approx([8.0, 6.0], abs=0.05)


def test_ranges_switched_off_lead_to_coasting():
    subject = tracked()
    for ms in range(0, 1000, 100):
        subject.update(round_at(ms), late=False)
    assert subject.mode(T0 + 900 * NS_PER_MS) is Mode.UWB_ONLY
    subject.disabled.add(Source.RANGE)
    for ms in range(1000, 3000, 100):
        subject.update(round_at(ms), late=False)
    assert subject.mode(T0 + 2900 * NS_PER_MS) is Mode.COASTING


def test_who_begins_at_a_place_is_there_whatever_was_believed_and_whenever_it_was():
    subject = tracked()
    subject.update(round_at(5000), late=False)
    assert subject.output(T0 + 5 * NS_PER_S) is not None
    subject.begin(T0, np.array([70.0, 1.0]), 0.04 * np.eye(2), (0.5, 0.01))
    output = subject.output(T0)
    assert (output.stamp_ns, output.position_m.tolist(), output.since_uwb_s) == (T0, [70.0, 1.0], np.inf)
    assert output.yaw_offset_rad == pytest.approx(0.5)
    assert subject.mode(T0) is Mode.COASTING


def test_a_region_places_a_person_of_whom_nothing_is_known_and_follows():
    subject = tracked()
    (verdict,) = subject.use_region(T0, region())
    assert (verdict.source, verdict.reason) == (Source.REGION, Reason.ACCEPTED)
    assert subject.mode(T0) is Mode.COARSE_ONLY
    assert subject.output(T0).covariance[:2, :2] == pytest.approx(25.0 * np.eye(2), rel=1e-3)
    assert len(subject.use_region(T0 + NS_PER_S, region(9.0))) == 1


def test_a_region_counts_only_after_ranges_have_been_silent_for_long():
    subject, after_s = tracked(), FusionParameters().region_after_s
    subject.update(round_at(0), late=False)
    before = subject.output(T0)
    early_ns = T0 + round((after_s - 0.1) * NS_PER_S)
    assert subject.use_region(early_ns, region()) == ()
    assert subject.mode(early_ns) is Mode.COASTING
    assert subject.epochs == 1
    assert np.array_equal(subject._corrector.estimate(T0).covariance, before.covariance)
    late_ns = T0 + round((after_s + 0.1) * NS_PER_S)
    assert [v.reason for v in subject.use_region(late_ns, region())] == [Reason.ACCEPTED]
    assert subject.mode(late_ns) is Mode.COARSE_ONLY


def test_a_region_switched_off_is_disabled():
    subject = tracked()
    subject.disabled.add(Source.REGION)
    assert [v.reason for v in subject.use_region(T0, region())] == [Reason.DISABLED]
    assert subject.output(T0) is None
