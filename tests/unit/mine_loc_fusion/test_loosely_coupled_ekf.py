"""The extended Kalman filter: where, how sure, on what it rests; never NaN, never surer than it may be."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S, to_ns
from mine_loc_core.verdicts import Reason, Source
from mine_loc_fusion.ekf import Ekf, EkfSettings
from mine_loc_fusion.estimate import EpochInputs, PositionFix, StepFix
from mine_loc_fusion.mode import Mode, ModeLimits, mode_of

LIMITS = ModeLimits(uwb_timeout_s=1.0, step_timeout_s=2.0, lost_ce95_m=50.0)
T0 = 1_760_000_000 * NS_PER_S


def at(seconds):
    return T0 + to_ns(seconds)


def fix(x, y, sd=0.1):
    return PositionFix(np.array([x, y], dtype=float), np.eye(2) * sd**2)


def step(length_m=0.6, heading=0.0, interval_s=0.5, length_sd=0.06, heading_sd=0.05):
    return StepFix(length_m, length_sd**2, heading, heading_sd**2, interval_s)


def position(subject, seconds, x, y, sd=0.1):
    return subject.update(EpochInputs(at(seconds), positions=(fix(x, y, sd),)))[0]


def standing(seconds=5.0, **parameters):
    subject = Ekf(EkfSettings(**parameters))
    for i in range(round(seconds * 10)):
        position(subject, i / 10, 3.0, 4.0)
    return subject


def walk(seconds, *, yaw, seed=0, steps=True, drop=lambda _: False, sd=0.1):
    """Along an L at 1.2 m/s: ten positions and two steps a second; the odom frame is turned by −yaw."""
    rng = np.random.default_rng(seed)
    subject, errors = Ekf(), []
    truth = np.zeros(2)
    for i in range(1, round(seconds * 10) + 1):
        direction = 0.0 if i < seconds * 5 else math.pi / 2
        truth = truth + 0.12 * np.array([math.cos(direction), math.sin(direction)])
        positions = () if drop(i / 10) else (fix(*(truth + rng.normal(0, sd, 2)), sd),)
        heading = direction - yaw + rng.normal(0, 0.05)
        taken = (step(0.6 + rng.normal(0, 0.03), heading),) if steps and i % 5 == 0 else ()
        subject.update(EpochInputs(at(i / 10), positions, taken))
        errors.append(float(np.linalg.norm(subject.estimate(at(i / 10)).position_m - truth)) if i > 10 else 0.0)
    return subject, np.array(errors)


def test_before_the_first_position_there_is_no_estimate_and_a_step_does_not_make_one():
    subject = Ekf()
    assert subject.update(EpochInputs(T0, steps=(step(),)))[0].reason is Reason.NOT_INITIALISED
    assert subject.estimate(T0) is None


def test_the_first_position_is_taken_as_it_is():
    subject = Ekf()
    verdict = position(subject, 0, 3, 4, sd=0.5)
    estimate = subject.estimate(T0)
    assert verdict.accepted
    assert estimate.position_m == pytest.approx([3, 4])
    assert np.sqrt(np.diag(estimate.covariance)[:2]) == pytest.approx(0.5, rel=0.1)
    assert (mode_of(estimate, LIMITS), estimate.since_uwb_s, estimate.since_step_s) == (Mode.UWB_ONLY, 0.0, math.inf)
    assert estimate.yaw_offset_rad is None


def test_an_outlier_is_refused_by_the_gate_with_its_figures_and_does_not_move_the_estimate():
    subject = standing()
    verdict = position(subject, 5.0, 48.0, 4.0)
    assert (verdict.source, verdict.reason) == (Source.UWB_POSE, Reason.GATE)
    assert verdict.mahalanobis_sq > verdict.threshold
    assert verdict.degrees_of_freedom == 2
    assert verdict.innovation == pytest.approx(45.0, abs=0.2)
    assert subject.estimate(at(5.0)).position_m == pytest.approx([3, 4], abs=0.1)


def test_positions_that_disagree_for_too_long_are_believed():
    subject = standing(reopen_s=2.0)
    reasons = [position(subject, 5 + i / 10, 48.0, 4.0).reason for i in range(21)]
    assert reasons[:20] == [Reason.GATE] * 20
    assert reasons[20] is Reason.ACCEPTED
    assert subject.estimate(at(7.0)).position_m == pytest.approx([48, 4], abs=0.01)


def test_a_good_position_between_outliers_keeps_the_gate_shut():
    subject = standing(reopen_s=2.0)
    for i in range(60):
        x = 3.0 if i % 15 == 14 else 48.0
        assert position(subject, 5 + i / 10, x, 4.0).reason is (Reason.ACCEPTED if x == 3.0 else Reason.GATE)


def test_without_inputs_the_covariance_grows_until_the_person_is_lost_and_the_position_stays_near():
    subject = standing()
    estimates = [subject.estimate(at(5 + seconds)) for seconds in (0, 1, 2, 5, 20, 100, 600, 3600)]
    areas = [np.linalg.det(estimate.covariance[:2, :2]) for estimate in estimates]
    assert all(a < b for a, b in itertools.pairwise(areas[:7]))
    assert areas[7] >= areas[6]
    modes = [mode_of(estimate, LIMITS) for estimate in estimates]
    assert modes[0] is Mode.UWB_ONLY
    assert modes[3] is Mode.COASTING
    assert modes[-1] is Mode.LOST
    assert all(np.linalg.norm(estimate.position_m - [3, 4]) < 1.0 for estimate in estimates)


@pytest.mark.parametrize("yaw", [0.0, 1.0, 3.1, -2.0])
def test_the_yaw_of_the_odom_frame_is_found_from_a_walked_track_within_what_it_claims(yaw):
    errors = []
    for seed in range(10):
        subject, _ = walk(20, yaw=yaw, seed=seed)
        error = math.remainder(subject.estimate(at(20)).yaw_offset_rad - yaw, 2 * math.pi)
        errors.append(error / math.sqrt(subject._P[4, 4]))
    assert np.abs(errors).max() < 3.0
    assert np.sqrt(np.mean(np.square(errors))) < 1.3


def test_steps_make_a_walk_more_accurate_while_positions_are_missing_and_the_mode_tells_it():
    def gap(seconds):
        return 14 < seconds <= 20

    with_steps, errors = walk(20, yaw=0.7, drop=gap)
    without, errors_without = walk(20, yaw=0.7, drop=gap, steps=False)
    assert errors[-1] < 0.5 * errors_without[-1]
    assert errors[-1] < 2.0
    assert mode_of(with_steps.estimate(at(20)), LIMITS) is Mode.DEAD_RECKONING
    assert mode_of(without.estimate(at(20)), LIMITS) is Mode.COASTING


def test_steps_do_not_spoil_a_walk_with_positions_and_the_mode_tells_them():
    runs = [
        (walk(20, yaw=0.7, seed=seed, sd=0.3), walk(20, yaw=0.7, seed=seed, sd=0.3, steps=False)) for seed in range(5)
    ]
    with_steps = np.sqrt(np.mean([np.mean(a[1][60:] ** 2) for a, _ in runs]))
    without = np.sqrt(np.mean([np.mean(b[1][60:] ** 2) for _, b in runs]))
    assert with_steps < without
    assert mode_of(runs[0][0][0].estimate(at(20)), LIMITS) is Mode.UWB_PDR


@pytest.mark.parametrize(
    "bad",
    [
        PositionFix(np.array([math.nan, 0.0]), np.eye(2)),
        PositionFix(np.array([math.inf, 0.0]), np.eye(2)),
        PositionFix(np.array([1e300, 0.0]), np.eye(2)),
        PositionFix(np.zeros(2), np.eye(2) * math.nan),
        PositionFix(np.zeros(2), -np.eye(2)),
        PositionFix(np.zeros(2), np.eye(2) * 1e300),
    ],
)
def test_an_impossible_position_is_refused_as_invalid(bad):
    subject = standing()
    before = subject.estimate(at(5))
    assert [v.reason for v in subject.update(EpochInputs(at(5), (bad,)))] == [Reason.INVALID]
    assert np.array_equal(subject.estimate(at(5)).covariance, before.covariance)


@pytest.mark.parametrize(
    "changed",
    [
        {"length_m": math.nan},
        {"length_m": -0.1},
        {"length_m": 1e9},
        {"heading": math.inf},
        {"length_sd": math.nan},
        {"length_sd": 2e8},
        {"heading_sd": math.inf},
    ],
)
def test_an_impossible_step_is_refused_as_invalid(changed):
    assert standing().update(EpochInputs(at(5), steps=(step(**changed),)))[0].reason is Reason.INVALID


NUMBER = st.floats() | st.floats(-1.0, 1.0) | st.floats(-100.0, 100.0)
EPOCH = st.builds(
    EpochInputs,
    st.integers(0, 600_000).map(lambda ms: T0 + ms * NS_PER_MS),
    st.lists(
        st.builds(
            lambda a, b, c, d, e: PositionFix(np.array([a, b]), np.array([[c, e], [e, d]])),
            NUMBER, NUMBER, NUMBER, NUMBER, NUMBER,
        ),
        max_size=2,
    ).map(tuple),
    st.lists(st.builds(StepFix, NUMBER, NUMBER, NUMBER, NUMBER, NUMBER), max_size=2).map(tuple),
)  # fmt: skip


@settings(max_examples=60)
@given(st.lists(EPOCH, max_size=30), st.booleans())
def test_no_input_makes_the_estimate_nan_or_its_covariance_indefinite(epochs, known):
    subject = walk(15, yaw=0.3)[0] if known else Ekf()
    for epoch in sorted(epochs, key=lambda e: e.stamp_ns):
        verdicts = subject.update(epoch)
        assert len(verdicts) == len(epoch.positions) + len(epoch.steps)
        estimate = subject.estimate(epoch.stamp_ns + NS_PER_S)
        if estimate is None:
            continue
        assert np.isfinite(estimate.position_m).all()
        assert np.isfinite(estimate.velocity_ms).all()
        assert np.isfinite(estimate.covariance).all()
        values = np.linalg.eigvalsh(estimate.covariance)
        assert values[0] >= -1e-9 * max(values[-1], 1.0)
