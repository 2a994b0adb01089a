"""What every estimator promises, whatever its name."""

import numpy as np
import pytest
from garbage import Garbage
from hypothesis import given, settings
from hypothesis import strategies as st
from walks import T0, Walk, at, is_covariance, position_fix

from mine_loc_core.stamps import NS_PER_S
from mine_loc_core.verdicts import Reason
from mine_loc_fusion.estimate import EpochInputs
from mine_loc_fusion.estimators import RIVALS, make_estimator
from mine_loc_fusion.los_weighted import LosWeighted
from mine_loc_fusion.parameters import METHODS
from mine_loc_fusion.tightly_coupled import TightlyCoupled

SEEDS = st.integers(0, 2**32 - 1)


def test_every_method_has_an_estimator_and_every_estimator_a_method():
    assert set(METHODS) == {"mine_loc", *RIVALS}
    assert METHODS[0] == "mine_loc"
    assert isinstance(make_estimator("mine_loc", 0.2, None, None), TightlyCoupled)
    made = make_estimator("los_weighted_residual", 0.2, None, None)
    assert isinstance(made, LosWeighted)
    assert (made._s.residual_gate, make_estimator("los_weighted", 0.2, None, None)._s.residual_gate) == (3.0, None)


@pytest.mark.parametrize("method", METHODS)
def test_each_call_makes_a_new_one(method):
    one, other = make_estimator(method, 0.2, None, None), make_estimator(method, 0.2, None, None)
    one.update(EpochInputs(T0, positions=(position_fix(1.0, 2.0),)))
    assert one.estimate(T0) is not None
    assert other.estimate(T0) is None


@pytest.mark.parametrize("method", METHODS)
def test_all_follow_a_walk_by_positions_and_steps(method):
    subject, walk = make_estimator(method, 0.2, None, None), Walk()
    subject.begin(walk.stamp_ns, walk.place_m, 0.01 * np.eye(2), (walk.yaw_rad, 0.01))
    errors = walk.play(subject, 40.0, ranges=False, positions=True)
    assert errors[100:].mean() < 0.5
    estimate = subject.estimate(walk.stamp_ns)
    assert (estimate.since_uwb_s, estimate.since_step_s) == (0.0, 0.0)
    assert estimate.yaw_offset_rad == pytest.approx(walk.yaw_rad, abs=0.2)


@pytest.mark.parametrize("method", METHODS)
def test_all_begin_where_they_are_told_and_have_the_yaw(method):
    subject = make_estimator(method, 0.2, None, None)
    subject.begin(T0, np.array([3.0, 4.0]), np.array([[0.5, 0.3], [0.1, 0.5]]), (0.4, 0.01))
    estimate = subject.estimate(T0)
    assert estimate.position_m.tolist() == [3.0, 4.0]
    assert estimate.yaw_offset_rad == pytest.approx(0.4)
    assert is_covariance(estimate.covariance)


@pytest.mark.parametrize("method", METHODS)
def test_asking_changes_nothing(method):
    asked, alone, walk = make_estimator(method, 0.2, None, None), make_estimator(method, 0.2, None, None), Walk()
    for _ in range(200):
        epoch = walk.next(positions=True)
        alone.update(epoch)
        asked.update(epoch)
        asked.estimate(epoch.stamp_ns + 5 * NS_PER_S)
    a, b = asked.estimate(walk.stamp_ns), alone.estimate(walk.stamp_ns)
    assert np.array_equal(a.position_m, b.position_m)
    assert np.array_equal(a.covariance, b.covariance)


@pytest.mark.parametrize("method", METHODS)
def test_what_is_restored_goes_on_to_the_same_estimate(method):
    subject, walk = make_estimator(method, 0.2, None, None), Walk()
    walk.play(subject, 3.0, positions=True, ranges=False)
    saved, epochs, ends = subject.save(), [walk.next(positions=True, ranges=False) for _ in range(100)], []
    for _ in range(3):
        for epoch in epochs:
            subject.update(epoch)
        ends.append(subject.estimate(walk.stamp_ns))
        subject.restore(saved)
    for end in ends[1:]:
        assert np.array_equal(end.position_m, ends[0].position_m)
        assert np.array_equal(end.covariance, ends[0].covariance)
        assert end.yaw_offset_rad == ends[0].yaw_offset_rad is not None


@pytest.mark.parametrize("method", METHODS)
@settings(max_examples=60)
@given(seed=SEEDS, known=st.booleans())
def test_all_survive_whatever_they_are_told(method, seed, known):
    subject, walk = make_estimator(method, 0.2, None, None), Walk()
    walk.play(subject, 10.0 if known else 0.0, positions=True, ranges=False)
    garbage = Garbage(seed, start_ns=walk.stamp_ns)
    for _ in range(30):
        epoch = garbage.epoch()
        verdicts = subject.update(epoch)
        assert Reason.UNKNOWN not in {verdict.reason for verdict in verdicts}
        for later_ns in (0, NS_PER_S, 3600 * NS_PER_S):
            estimate = subject.estimate(epoch.stamp_ns + later_ns)
            if estimate is None:
                continue
            assert np.isfinite(estimate.position_m).all()
            assert np.isfinite(estimate.velocity_ms).all()
            assert is_covariance(estimate.covariance)


@pytest.mark.parametrize("method", METHODS)
def test_without_inputs_nobody_becomes_surer(method):
    subject, walk = make_estimator(method, 0.2, None, None), Walk()
    walk.play(subject, 20.0, positions=True, ranges=False)
    spreads = [np.trace(subject.estimate(at(20.0 + s)).covariance[:2, :2]) for s in range(0, 600, 10)]
    assert (np.diff(spreads) > 0.0).all()


def test_what_stays_of_a_links_error_widens_the_claim_and_moves_nothing():
    calibrated, uncalibrated = make_estimator("mine_loc", 0.0, None, None), make_estimator("mine_loc", 0.2, None, None)
    walks = Walk(), Walk()
    for _ in range(300):
        calibrated.update(walks[0].next())
        uncalibrated.update(walks[1].next())
    sure, unsure = calibrated.estimate(walks[0].stamp_ns), uncalibrated.estimate(walks[1].stamp_ns)
    assert unsure.position_m == pytest.approx(sure.position_m)
    widened = np.linalg.eigvalsh(unsure.covariance[:2, :2] - sure.covariance[:2, :2])
    assert 0.1**2 < widened[0] <= widened[1] < 0.5**2
