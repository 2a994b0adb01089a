"""The rivals built on the plain filter: one learns how large errors are, one weakens what is too far off."""

import math

import numpy as np
import pytest
from walks import T0, at, position_fix

from mine_loc_core.gates import chi2_quantile
from mine_loc_core.verdicts import Reason
from mine_loc_fusion.adaptive_ekf import AdaptiveEkf
from mine_loc_fusion.ekf import Ekf
from mine_loc_fusion.estimate import EpochInputs
from mine_loc_fusion.robust_kf import RobustKf


def stood(subject, sd_m, seconds=20.0, seed=0):
    """Somebody who stands at the origin and is seen with this error, while 0.1 m is claimed."""
    rng = np.random.default_rng(seed)
    for number in range(round(seconds * 10)):
        subject.update(EpochInputs(at(number / 10), positions=(position_fix(*rng.normal(0.0, sd_m, 2)),)))
    return subject


def moved_by(subject, east_m):
    """How far a single position so far off moves somebody; and its verdict."""
    before_m = subject.estimate(at(20.0)).position_m
    (verdict,) = subject.update(EpochInputs(at(20.0), positions=(position_fix(east_m, 0.0),)))
    return float(np.linalg.norm(subject.estimate(at(20.0)).position_m - before_m)), verdict


def test_the_adaptive_filter_learns_a_larger_noise_from_larger_errors():
    learnt = [np.trace(stood(AdaptiveEkf(), sd_m)._R) for sd_m in (0.05, 0.3, 1.0)]
    assert learnt[0] < 0.5 * learnt[1] < 0.1 * learnt[2]
    assert math.sqrt(learnt[2] / 2.0) == pytest.approx(1.0, rel=0.4)


def test_what_the_adaptive_filter_learns_is_the_mean_of_sage_and_husa():
    subject, P, R = AdaptiveEkf(memory=0.9), 0.1 * np.eye(2), 0.04 * np.eye(2)
    first = subject._noise(R, np.array([1.0, 0.0]), P)
    share = 0.1 / (1.0 - 0.9**2)
    assert first == pytest.approx(np.diag([(1 - share) * 0.04 + share * 0.9, 0.1 * 0.04]), rel=0.3, abs=1e-2)
    assert first[0, 0] == pytest.approx((1.0 - share) * 0.04 + share * 0.9)
    share = 0.1 / (1.0 - 0.9**3)
    assert subject._noise(R, np.array([1.0, 0.0]), P)[0, 0] == pytest.approx((1.0 - share) * first[0, 0] + share * 0.9)


def test_the_adaptive_filter_never_learns_less_than_a_tenth_of_what_is_claimed():
    subject, R = AdaptiveEkf(), 0.04 * np.eye(2)
    for _ in range(200):
        learnt = subject._noise(R, np.zeros(2), np.eye(2))
    assert np.linalg.eigvalsh(learnt) == pytest.approx([0.004, 0.004])


def test_after_noisy_times_the_adaptive_filter_follows_a_position_less_than_the_plain_one():
    adaptive, plain = (moved_by(stood(each, 0.2, seed=3), 0.3)[0] for each in (AdaptiveEkf(), Ekf()))
    assert 0.0 < adaptive < 0.9 * plain


def test_an_outlier_moves_the_robust_filter_less_than_the_plain_one():
    for east_m in (0.65, 0.75):
        robust, verdict = moved_by(stood(RobustKf(), 0.1), east_m)
        plain, taken = moved_by(stood(Ekf(), 0.1), east_m)
        assert taken.reason is verdict.reason is Reason.ACCEPTED
        assert 0.0 < robust < 0.8 * plain


def test_the_robust_filter_takes_what_is_likely_as_the_plain_one_does():
    robust, plain = (moved_by(stood(each, 0.1), 0.1)[0] for each in (RobustKf(), Ekf()))
    assert robust == plain > 0.0


def test_the_robust_filter_inflates_noise_until_the_distance_is_its_quantile():
    subject, R, P = RobustKf(trust=0.9), 0.04 * np.eye(2), np.array([[0.2, 0.05], [0.05, 0.1]])
    innovation = np.array([30.0, -7.0])
    inflated = subject._noise(R, innovation, P)
    assert innovation @ np.linalg.solve(P + inflated, innovation) == pytest.approx(chi2_quantile(0.9, 2))
    assert np.linalg.eigvalsh(inflated)[0] > 0.0


def test_the_robust_filter_refuses_nothing_and_the_plain_one_refuses_what_is_far():
    assert moved_by(stood(RobustKf(), 0.1), 40.0)[1].reason is Reason.ACCEPTED
    assert moved_by(stood(Ekf(), 0.1), 40.0)[1].reason is Reason.GATE
    assert stood(RobustKf(), 0.1).estimate(T0).since_uwb_s == 0.0
