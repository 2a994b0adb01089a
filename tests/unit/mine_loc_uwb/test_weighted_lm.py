"""Weighted Levenberg–Marquardt against scipy's, and the Kalman filter of paper C around it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares as scipy_least_squares
from uwb_scenes import LINE, ROOM, Tag, distances, is_covariance, sd_m

from mine_loc_core.verdicts import Reason
from mine_loc_uwb.fix import FixStatus
from mine_loc_uwb.least_squares import LeastSquares
from mine_loc_uwb.weighted_lm import WeightedLmFilter, WeightedLmSettings, advance, predict, weighted_lm

SEEDS = st.integers(0, 2**32 - 1)
HEIGHT_M = 1.0


def residual(position, anchors, ranges):
    return ranges - distances(anchors, np.append(position, HEIGHT_M) if len(position) == 2 else position)


def cost(position, anchors, ranges, weights):
    return float(weights @ residual(position, anchors, ranges) ** 2)


@settings(max_examples=40)
@given(SEEDS, st.integers(4, 10), st.sampled_from([2, 3]))
def test_it_finds_the_minimum_that_scipy_finds(seed, count, dimensions):
    rng = np.random.default_rng(seed)
    anchors, tag = rng.uniform([0, 0, 0], [30, 30, 10], (count, 3)), rng.uniform([5, 5, 1], [25, 25, 1], 3)
    ranges, weights = distances(anchors, tag) + rng.normal(0, 0.1, count), rng.uniform(0.1, 5.0, count)
    start = tag[:dimensions] + rng.normal(0, 0.3, dimensions)
    found = weighted_lm(start, anchors, ranges, weights, HEIGHT_M)
    scipys = scipy_least_squares(lambda x: np.sqrt(weights) * residual(x, anchors, ranges), start, xtol=1e-12).x
    # Along a flat valley it stops a little earlier, where a step is less than 0.1 mm.
    assert cost(found, anchors, ranges, weights) <= 1.05 * cost(scipys, anchors, ranges, weights) + 1e-3


@settings(max_examples=40)
@given(SEEDS, st.integers(1, 8), st.sampled_from([2, 3]), st.floats(0.0, 100.0))
def test_the_residual_never_grows_from_any_start_on_any_geometry(seed, count, dimensions, astray_m):
    rng = np.random.default_rng(seed)
    anchors, ranges = rng.uniform(0, 30, (count, 3)), rng.uniform(0.1, 60.0, count)
    weights, start = rng.uniform(0.0, 5.0, count), rng.normal(0, 1.0 + astray_m, dimensions)
    found = weighted_lm(start, anchors, ranges, weights, HEIGHT_M)
    assert np.isfinite(found).all()
    assert cost(found, anchors, ranges, weights) <= cost(start, anchors, ranges, weights)


def test_a_range_of_weight_0_does_not_count():
    ranges, weights = distances(ROOM, (6.0, 5.0, HEIGHT_M)), np.array([1.0, 1, 1, 1, 1, 0])
    ranges[5] += 7.0
    assert weighted_lm(np.array([9.0, 9.0]), ROOM, ranges, weights, HEIGHT_M) == pytest.approx([6.0, 5.0], abs=1e-3)


def test_prediction_is_constant_velocity_under_white_acceleration():
    state = np.array([[1.0, 2.0, 0.4, 0.1, 0.3]])
    gone_s, q = 0.7, 0.5
    F, P = np.array([[1.0, gone_s], [0.0, 1.0]]), np.array([[0.4, 0.1], [0.1, 0.3]])
    Q = q * np.array([[gone_s**3 / 3, gone_s**2 / 2], [gone_s**2 / 2, gone_s]])
    expected = F @ P @ F.T + Q
    predict(state, gone_s, q)
    assert state[0, :2] == pytest.approx([1.0 + 2.0 * gone_s, 2.0])
    assert state[0, 2:] == pytest.approx([expected[0, 0], expected[0, 1], expected[1, 1]])


def run(subject, tag, instants, **options):
    return [subject.solve(tag.round(at_s, **options)) for at_s in instants]


def test_the_first_two_fixes_are_plain_least_squares_and_give_the_first_velocity():
    tag = Tag(sd_m=1e-6, velocity_m_s=(1.0, -0.5, 0.0))
    subject, plain = WeightedLmFilter(), LeastSquares()
    for at_s in (0.0, 0.5):
        round_ = tag.round(at_s)
        assert subject.solve(round_).fix.position_m.tolist() == plain.solve(round_).fix.position_m.tolist()
    blind = subject.solve(tag.round(1.5, only=[]))
    assert blind.fix.position_m == pytest.approx(tag.at(1.5), abs=1e-3)


@pytest.mark.parametrize("space", [False, True])
def test_irregular_intervals_are_followed(space):
    rng = np.random.default_rng(3)
    tag = Tag(3, velocity_m_s=(1.0, 0.4, 0.0), start_m=(3.0, 4.0, 1.0), space=space)
    instants = np.cumsum(rng.uniform(0.05, 1.2, 25))
    subject = WeightedLmFilter()
    errors = [tag.error_m(s.fix, at_s) for s, at_s in zip(run(subject, tag, instants), instants, strict=True)]
    assert np.mean(errors[5:]) < (0.2 if space else 0.06)


def test_with_spikes_on_a_tenth_of_the_ranges_it_errs_half_as_much_as_least_squares():
    tag, subject, plain = Tag(7, velocity_m_s=(0.8, 0.3, 0.0)), WeightedLmFilter(), LeastSquares()
    run(subject, tag, [0.0, 0.5])
    errors = []
    for at_s in np.arange(1.0, 15.0, 0.5):
        late = np.flatnonzero(tag.rng.random(len(ROOM)) < 0.1)
        round_ = tag.round(at_s, excess={place: tag.rng.uniform(1.0, 3.0) for place in late.tolist()})
        errors.append([tag.error_m(solver.solve(round_).fix, at_s) for solver in (subject, plain)])
    ours, theirs = np.mean(errors, axis=0)
    assert ours < 0.5 * theirs


@pytest.mark.parametrize("excess_m", [3.0, -3.0])
@pytest.mark.parametrize("place", range(len(ROOM)))
def test_a_spike_on_one_range_moves_the_fix_much_less_than_plain_multilateration(place, excess_m):
    tag, subject = Tag(5), WeightedLmFilter()
    run(subject, tag, np.arange(0.0, 5.0, 0.5))
    spiked = tag.round(5.0, excess={place: excess_m})
    ours, plain = tag.error_m(subject.solve(spiked).fix, 5.0), tag.error_m(LeastSquares().solve(spiked).fix, 5.0)
    assert plain > 0.3
    assert ours < 0.35 * plain


@pytest.mark.parametrize("heard", [0, 1])
def test_too_few_ranges_coast_with_growing_covariance_and_are_not_called_accepted(heard):
    tag, subject = Tag(6, velocity_m_s=(0.7, 0.0, 0.0)), WeightedLmFilter()
    tracked = run(subject, tag, np.arange(0.0, 5.0, 0.5))[-1]
    spreads = [sd_m(tracked.fix)]
    for at_s in np.arange(5.0, 8.0, 0.5):
        solution = subject.solve(tag.round(at_s, only=range(heard)))
        assert solution.fix.status is FixStatus.OK
        assert solution.fix.ranges_used == 0
        assert solution.reasons == (Reason.DEGENERATE,) * heard
        spreads.append(sd_m(solution.fix))
    assert (np.diff(spreads) > 0.0).all()
    assert tag.error_m(solution.fix, at_s) < 3.0 * spreads[-1]


def test_after_a_long_silence_it_begins_anew():
    tag, subject = Tag(8), WeightedLmFilter(WeightedLmSettings(restart_after_s=10.0))
    run(subject, tag, np.arange(0.0, 5.0, 0.5))
    few = subject.solve(tag.round(20.0, only=[0, 1]))
    assert few.fix.status is FixStatus.TOO_FEW_RANGES
    round_ = tag.round(20.5)
    assert subject.solve(round_).fix.position_m.tolist() == LeastSquares().solve(round_).fix.position_m.tolist()


def test_anchors_on_a_line_never_begin_it():
    tag, subject = Tag(anchors=LINE, start_m=(20.0, 4.0, 1.0)), WeightedLmFilter()
    for solution in run(subject, tag, np.arange(0.0, 3.0, 0.5)):
        assert solution.fix.status is FixStatus.DEGENERATE
        assert set(solution.reasons) == {Reason.DEGENERATE}


def test_the_covariance_is_that_of_a_steady_filter():
    tag, subject = Tag(9), WeightedLmFilter()
    spreads = [sd_m(solution.fix) for solution in run(subject, tag, np.arange(0.0, 20.0, 0.5))]
    assert spreads[-1] < 0.9 * spreads[0]
    assert spreads[-1] == pytest.approx(spreads[-2], rel=0.05)


def test_one_call_advances_a_running_filter_as_predict_and_update_do():
    tag, subject = Tag(10), WeightedLmFilter()
    run(subject, tag, [0.0, 0.5])
    state, round_ = subject._state.copy(), tag.round(1.0)
    advance(state, 0.5, round_.anchors_m, round_.range_m, round_.variance_m2[0], 1.0, 0.5, 0.05)
    solution = subject.solve(round_)
    assert solution.fix.position_m[:2] == pytest.approx(state[:, 0])
    assert solution.fix.covariance_m2[0, 0] == pytest.approx(state[0, 2])
    assert is_covariance(solution.fix.covariance_m2)
    assert math.isfinite(solution.fix.gdop)
