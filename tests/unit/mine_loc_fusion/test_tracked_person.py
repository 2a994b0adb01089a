"""One person under fusion: output stamps never go back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_core.people import Person, Stride
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_core.verdicts import Reason
from mine_loc_fusion.estimate import EpochInputs, PositionFix
from mine_loc_fusion.mode import Mode
from mine_loc_fusion.parameters import FusionParameters
from mine_loc_fusion.tracked_person import TrackedPerson

T0 = 1_760_000_000 * NS_PER_S


def tracked():
    return TrackedPerson(Person("ann", 1, 1.7, None, Stride(), None), FusionParameters())


def epoch(ms, x=0.0):
    return EpochInputs(T0 + ms * NS_PER_MS, (PositionFix(np.array([x, 0.0]), np.eye(2) * 0.01),))


@settings(max_examples=50, deadline=None)
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
