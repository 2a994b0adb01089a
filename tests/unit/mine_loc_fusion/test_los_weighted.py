"""Paper A's fusion: the weights are those of relative accuracy, and steps carry on the last fused position."""

import cmath
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from walks import T0, Walk, at, position_fix, step_fix

from mine_loc_core.verdicts import Reason, Source
from mine_loc_fusion.estimate import EpochInputs
from mine_loc_fusion.late_inputs import LateInputCorrector
from mine_loc_fusion.los_weighted import LosWeighted, LosWeightedSettings

PLAIN = LosWeightedSettings()
TESTED = LosWeightedSettings(residual_gate=3.0)


def begun(told=PLAIN, sd_m=0.5, yaw_rad=0.0):
    subject = LosWeighted(told)
    subject.begin(T0, np.zeros(2), sd_m**2 * np.eye(2), (yaw_rad, 0.0))
    return subject


def use(subject, seconds, **what):
    return subject.update(EpochInputs(at(seconds), **what))


def variance_m2(subject, seconds):
    return subject.estimate(at(seconds)).covariance[0, 0]


@given(st.floats(0.0, 1.0) | st.just(math.nan), st.floats(0.01, 5.0))
def test_a_position_is_weighted_by_its_class_and_the_accuracy_of_both(los, sd_m):
    subject = begun(sd_m=sd_m)
    (verdict,) = use(subject, 0.0, positions=(position_fix(1.0, -2.0, los=los),))
    p = 0.5 if math.isnan(los) else los
    uwb_m2 = p * PLAIN.los_sd_m**2 + (1.0 - p) * PLAIN.nlos_sd_m**2
    weight = sd_m**2 / (uwb_m2 + sd_m**2)
    assert verdict.accepted
    assert subject.estimate(T0).position_m == pytest.approx([weight, -2.0 * weight])
    assert variance_m2(subject, 0.0) == pytest.approx((1.0 - weight) * sd_m**2)
    assert verdict.mahalanobis_sq == pytest.approx(5.0 / (uwb_m2 + sd_m**2))


@pytest.mark.parametrize("los", [-1.0, 2.0, 1e30, math.inf, -math.inf])
def test_what_is_no_probability_counts_as_not_judged(los):
    told, unknown = begun(), begun()
    use(told, 0.0, positions=(position_fix(1.0, 0.0, los=los),))
    use(unknown, 0.0, positions=(position_fix(1.0, 0.0),))
    assert told.estimate(T0).position_m.tolist() == unknown.estimate(T0).position_m.tolist()
    assert variance_m2(told, 0.0) == variance_m2(unknown, 0.0)


def test_with_the_residual_test_a_clear_link_that_is_far_off_counts_as_obstructed_and_without_it_does_not():
    moved = {}
    for name, told in (("plain", PLAIN), ("tested", TESTED)):
        subject = begun(told, sd_m=0.2)
        (verdict,) = use(subject, 0.0, positions=(position_fix(3.0, 0.0, los=1.0),))
        moved[name] = subject.estimate(T0).position_m[0]
        assert verdict.mahalanobis_sq > 9.0
    assert moved["plain"] == pytest.approx(1.5)  # as sure as the track
    assert moved["tested"] == pytest.approx(3.0 * 0.04 / (0.04 + 25.0))


def test_within_what_both_explain_the_residual_test_changes_nothing():
    near = position_fix(0.5, 0.0, los=1.0)
    plain, tested = begun(PLAIN, 0.2), begun(TESTED, 0.2)
    for subject in (plain, tested):
        use(subject, 0.0, positions=(near,))
    assert tested.estimate(T0).position_m.tolist() == plain.estimate(T0).position_m.tolist()


def test_a_step_carries_the_position_on_along_its_heading_and_makes_it_less_sure():
    subject = begun(yaw_rad=0.5)
    (verdict,) = use(subject, 0.0, steps=(step_fix(0.8, 0.2),))
    assert (verdict.source, verdict.reason) == (Source.STEP, Reason.ACCEPTED)
    assert subject.estimate(T0).position_m == pytest.approx([0.8 * math.cos(0.7), 0.8 * math.sin(0.7)])
    assert variance_m2(subject, 0.0) == pytest.approx(0.25 + (PLAIN.step_share * 0.8) ** 2)


@settings(max_examples=40)
@given(st.integers(0, 2**32 - 1))
def test_the_factor_of_steps_follows_as_in_the_textbook_s_filter_of_two_complex_states(seed):
    rng, told = np.random.default_rng(seed), LosWeightedSettings(rest_sd_m=0.0, factor_walk_sd=0.0)
    subject = LosWeighted(told)
    subject.begin(T0, np.zeros(2), 0.01 * np.eye(2), (0.3, 0.04))
    x, P = np.array([0.0, cmath.rect(1.0, 0.3)]), np.diag([0.01, 0.04]).astype(complex)
    for number in range(30):
        length_m, heading = rng.uniform(0.3, 1.0), rng.uniform(-math.pi, math.pi)
        use(subject, 0.0, steps=(step_fix(length_m, heading, math.nan),))
        F = np.array([[1.0, cmath.rect(length_m, heading)], [0.0, 1.0]])
        x, P = F @ x, F @ P @ F.conj().T + np.diag([(told.step_share * length_m) ** 2, 0.0])
        if number % 3 == 0:
            place = rng.normal(x[0].real, 0.5), rng.normal(x[0].imag, 0.5)
            use(subject, 0.0, positions=(position_fix(*place, los=1.0),))
            gain = P[:, 0] / (P[0, 0] + told.los_sd_m**2)
            x = x + gain * (complex(*place) - x[0])
            P = P - np.outer(gain, P[0])
    found = subject.estimate(T0)
    assert found.position_m == pytest.approx([x[0].real, x[0].imag])
    assert found.covariance[0, 0] == pytest.approx(P[0, 0].real)
    assert math.remainder(found.yaw_offset_rad - cmath.phase(x[1]), math.tau) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("yaw_off_rad", "scale"), [(0.2, 1.0), (-0.2, 1.0), (0.0, 1.1), (0.1, 0.9)])
def test_steps_that_are_turned_and_stretched_are_put_right_by_positions(yaw_off_rad, scale):
    subject = LosWeighted()
    subject.begin(T0, np.zeros(2), 0.01 * np.eye(2), (yaw_off_rad, 0.04))
    for number in range(1, 41):
        fixes = (position_fix(0.7 * number, 0.0, los=1.0),)
        use(subject, 0.5 * number, steps=(step_fix(0.7 / scale, 0.0),), positions=fixes if number <= 20 else ())
    at_m, yaw_rad = subject.estimate(at(20.0)).position_m, subject.estimate(at(20.0)).yaw_offset_rad
    assert abs(yaw_rad) < 0.02
    assert np.linalg.norm(at_m - [28.0, 0.0]) < 0.3  # laid on the map once they would be off by 1.4 m and more


def test_between_steps_the_person_walks_on_and_the_next_step_replaces_what_was_guessed():
    subject = begun()
    use(subject, 0.0, steps=(step_fix(0.6, 0.0, 0.5),))
    assert subject.estimate(at(0.25)).position_m == pytest.approx([0.9, 0.0])
    use(subject, 0.25)
    use(subject, 0.5, steps=(step_fix(0.6, math.pi / 2.0, 0.5),))
    assert subject.estimate(at(0.5)).position_m == pytest.approx([0.6, 0.6])


def test_nobody_walks_on_for_more_than_a_second_without_a_step():
    subject = begun()
    use(subject, 0.0, steps=(step_fix(0.6, 0.0, 0.5),))
    assert subject.estimate(at(60.0)).position_m == pytest.approx([1.8, 0.0])


@pytest.mark.parametrize("interval_s", [math.nan, 0.0, -1.0, 1e-300, 1e-40])
def test_an_interval_that_no_step_has_tells_no_speed(interval_s):
    subject = begun()
    use(subject, 0.0, steps=(step_fix(0.6, 0.0, interval_s),))
    assert subject.estimate(at(1.0)).position_m == pytest.approx([0.6, 0.0])
    assert subject.estimate(at(1.0)).velocity_ms.tolist() == [0.0, 0.0]


def test_before_the_yaw_is_known_steps_find_it_and_move_nothing():
    subject, walk = LosWeighted(), Walk(yaw_rad=0.7)
    first = walk.next(ranges=False, positions=True)
    subject.update(first)
    while subject.estimate(walk.stamp_ns).yaw_offset_rad is None:
        assert walk.at_s < 10.0
        verdicts = subject.update(walk.next(ranges=False, positions=True))
        assert {v.reason for v in verdicts if v.source is Source.STEP} <= {Reason.NOT_INITIALISED}
    assert subject.estimate(walk.stamp_ns).yaw_offset_rad == pytest.approx(0.7, abs=0.2)


def test_late_steps_end_where_steps_on_time_do():
    epochs, walk = [], Walk()
    for _ in range(300):
        epoch = walk.next(ranges=False, positions=True)
        epochs.append((epoch.stamp_ns, EpochInputs(epoch.stamp_ns, positions=epoch.positions)))
        if epoch.steps:
            epochs.append((epoch.stamp_ns + 300_000_000, EpochInputs(epoch.stamp_ns, steps=epoch.steps)))
    estimates = []
    for arrival in (lambda row: row[1].stamp_ns, lambda row: row[0]):
        subject = LateInputCorrector(LosWeighted(), 2_000_000_000)
        for _, epoch in sorted(epochs, key=arrival):
            subject.update(epoch)
        estimates.append(subject.estimate(walk.stamp_ns))
    assert estimates[1].position_m == pytest.approx(estimates[0].position_m, abs=1e-9)
    assert estimates[1].covariance == pytest.approx(estimates[0].covariance, rel=1e-9)


def test_an_impossible_position_is_invalid_and_not_used():
    subject = begun()
    assert use(subject, 0.0, positions=(position_fix(math.nan, 0.0),))[0].reason is Reason.INVALID
    assert subject.estimate(T0).position_m.tolist() == [0.0, 0.0]
    assert subject.estimate(T0).since_uwb_s == math.inf
