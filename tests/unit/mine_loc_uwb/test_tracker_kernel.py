"""The tracker's arithmetic against the textbook: prediction by Van Loan, update by Kalman, offsets of blinks."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from uwb_scenes import ROOM, distances, is_covariance

from mine_loc_uwb import tracker_kernel as kernel
from mine_loc_uwb import tracker_round
from mine_loc_uwb.tracker_settings import RobustTrackerSettings

SETTINGS = RobustTrackerSettings()
NOISE = SETTINGS.noise()
SEEDS = st.integers(0, 2**32 - 1)
DIMENSIONS = st.sampled_from([2, 3])
NO_GATE = math.inf


def state(seed, dimensions, links):
    """A state of a person in the middle of the room with a full covariance."""
    rng = np.random.default_rng(seed)
    size = 2 * dimensions + 1 + links
    root = rng.normal(0.0, 0.1, (size, size))
    x = rng.normal(0.0, 0.1, size)
    x[:dimensions] += [8.0, 6.0, 1.0][:dimensions]
    return x, root @ root.T + 1e-4 * np.eye(size)


def van_loan(dimensions, links, gone_s):
    """F and Q of the linear model in continuous time: dx = A x dt + noise of spectral density S."""
    d, size = dimensions, 2 * dimensions + 1 + links
    A, S = np.zeros((size, size)), np.zeros((size, size))
    A[range(d), range(d, 2 * d)] = 1.0
    S[range(d, 2 * d), range(d, 2 * d)] = SETTINGS.acceleration_density_m2_s3
    for place in range(2 * d, size):
        common = place == 2 * d
        time_s = SETTINGS.common_bias_time_s if common else SETTINGS.bias_time_s
        sd_m = SETTINGS.common_bias_sd_m if common else SETTINGS.bias_sd_m
        A[place, place] = -1.0 / time_s
        S[place, place] = 2.0 * sd_m**2 / time_s
    block = expm(np.block([[-A, S], [np.zeros_like(A), A.T]]) * gone_s)
    F = block[size:, size:].T
    return F, F @ block[:size, size:]


@settings(max_examples=30)
@given(SEEDS, DIMENSIONS, st.integers(0, 5), st.floats(0.0, 30.0))
def test_prediction_is_that_of_the_continuous_model(seed, dimensions, links, gone_s):
    x, P = state(seed, dimensions, links)
    F, Q = van_loan(dimensions, links, gone_s)
    expected_x, expected_P = F @ x, F @ P @ F.T + Q
    kernel.predict(x, P, dimensions, 2 * dimensions + 1, gone_s, NOISE)
    assert x == pytest.approx(expected_x, rel=1e-9, abs=1e-12)
    assert pytest.approx(expected_P, rel=1e-6, abs=1e-9) == P


@settings(max_examples=30)
@given(SEEDS, DIMENSIONS, st.lists(st.floats(0.0, 5.0), min_size=1, max_size=10))
def test_prediction_keeps_the_covariance_symmetric_and_positive(seed, dimensions, steps_s):
    x, P = state(seed, dimensions, 3)
    for gone_s in steps_s:
        kernel.predict(x, P, dimensions, 2 * dimensions + 1, gone_s, NOISE)
    assert pytest.approx(P.T, rel=1e-12, abs=1e-15) == P
    assert np.linalg.eigvalsh(P)[0] > 0.0


def test_left_alone_biases_return_to_nothing_known():
    x, P = state(1, 2, 2)
    x[4:] = 1.0
    kernel.predict(x, P, 2, 5, 1e4, NOISE)
    assert x[4:] == pytest.approx(0.0, abs=1e-9)
    assert np.diag(P)[4:] == pytest.approx([SETTINGS.common_bias_sd_m**2] + 2 * [SETTINGS.bias_sd_m**2])


def take(
    x,
    P,
    dimensions,
    anchor,
    range_m,
    *,
    nlos=0.0,
    since_s=0.0,
    gate=NO_GATE,
    variance=0.01,
    reach_m=0.3,
    slot=0,
    fresh=1.0,
):
    return kernel.take_range(
        x, P, dimensions, 2 * dimensions + 1, np.asarray(anchor, float), slot, range_m, variance, since_s, 1.0, nlos,
        SETTINGS.nlos_scale_m, fresh, reach_m, gate, np.empty((3, len(x))),
    )  # fmt: skip


def textbook(x, P, H, innovation, variance):
    S = H @ P @ H + variance
    K = P @ H / S
    return x + K * innovation, P - np.outer(K, H @ P)


@settings(max_examples=30)
@given(SEEDS, DIMENSIONS, st.floats(-1.5, 1.5), st.floats(-0.2, 0.2), st.integers(0, 2))
def test_a_clear_range_of_a_far_anchor_is_a_textbook_kalman_update(seed, dimensions, z, since_s, slot):
    """Far away a distance is linear; without a chance of an obstruction its law is Gaussian but for the outliers."""
    x, P = state(seed, dimensions, 3)
    far = np.array([3e5, 4e5, 1.0])
    u = -np.array([0.6, 0.8, 0.0])[:dimensions]
    H = np.concatenate([u, since_s * u, [1.0], np.eye(3)[slot]])
    at = x[:dimensions] + since_s * x[dimensions : 2 * dimensions]
    offset = far - (np.append(at, 1.0) if dimensions == 2 else at)
    innovation = z * math.sqrt(H @ P @ H + 0.01)
    range_m = float(np.linalg.norm(offset)) + x[2 * dimensions] + x[2 * dimensions + 1 + slot] + innovation
    expected_x, expected_P = textbook(x, P, H, innovation, 0.01)
    code, deviance, _ = take(x, P, dimensions, far, range_m, since_s=since_s, slot=slot)
    assert code == kernel.ACCEPTED
    assert deviance == pytest.approx(z**2, abs=1e-3)
    assert x == pytest.approx(expected_x, abs=2e-3)
    assert pytest.approx(expected_P, rel=0.02, abs=1e-3) == P


@settings(max_examples=40)
@given(SEEDS, DIMENSIONS, st.floats(-3.0, 9.0), st.floats(0.0, 0.97), st.floats(1e-6, 4.0))
def test_any_range_leaves_a_finite_state_and_a_covariance_that_has_not_grown(seed, dimensions, error_m, nlos, variance):
    x, P = state(seed, dimensions, 2)
    before = P.copy()
    range_m = distances(ROOM[:1], (*x[:2], 1.0 if dimensions == 2 else x[2]))[0] + error_m
    _, _, after = take(x, P, dimensions, ROOM[0], range_m, nlos=nlos, variance=variance)
    assert np.isfinite(x).all()
    assert is_covariance((P + P.T) / 2)
    assert np.linalg.eigvalsh(before - P)[0] > -1e-9
    assert 0.0 <= after <= 1.0


def test_a_refused_range_leaves_the_state_as_it_was():
    gate = 15.0
    for error_m, reach_m, wanted in (
        (-45.0, 0.3, kernel.IMPOSSIBLE),
        (-3.0, 10.0, kernel.TOO_SHORT),
        (45.0, 0.3, kernel.TOO_LONG),
    ):
        x, P = state(2, 2, 1)
        before = x.copy(), P.copy()
        range_m = distances(ROOM[1:2], (*x[:2], 1.0))[0] + error_m
        code, deviance, nlos = take(x, P, 2, ROOM[1], range_m, nlos=0.4, gate=gate, reach_m=reach_m)
        assert (code, nlos) == (wanted, 0.4)
        assert deviance > gate
        assert (x == before[0]).all()
        assert (before[1] == P).all()


def test_a_range_believed_obstructed_pulls_less_than_one_believed_clear():
    moved = []
    for nlos in (0.01, 0.5, 0.97):
        x, P = state(3, 2, 1)
        before = x[:2].copy()
        take(x, P, 2, ROOM[2], distances(ROOM[2:3], (*x[:2], 1.0))[0] + 0.5, nlos=nlos)
        moved.append(float(np.linalg.norm(x[:2] - before)))
    assert moved[0] > 1.5 * moved[1] > 1.5 * moved[2]


def play(x, P, ranges, *, los=math.nan, link_nlos=None, ahead_s=0.1, gone_s=0.1, offset_unknown=0, gate=15.0):
    """A round of ranges of the room, `gone_s` after the last; codes, deviances and quality."""
    count = len(ranges)
    codes, deviances, quality = np.empty(count, np.int64), np.empty(count), np.empty(tracker_round.QUALITIES)
    tracker_round.take_round(
        x, P, 2, 5, ROOM[:count], np.arange(count), np.asarray(ranges, float), np.full(count, 0.01), np.zeros(count),
        1.0, np.full(count, los), np.full(count, math.nan), np.full(count, 0.5) if link_nlos is None else link_nlos,
        ahead_s, gone_s, offset_unknown, gate, NOISE, codes, deviances, quality, np.zeros((3, 3)),
    )  # fmt: skip
    return codes, deviances, quality


@settings(max_examples=30)
@given(SEEDS, st.floats(-200.0, 200.0))
def test_arrivals_of_a_blink_may_all_be_shifted_alike(seed, shift_m):
    arrivals = distances(ROOM, (8.2, 6.1, 1.0)) + np.random.default_rng(seed).normal(0.0, 0.1, len(ROOM))
    results = []
    for shift in (0.0, shift_m):
        x, P = state(seed, 2, len(ROOM))
        x[4:] *= 0.1
        codes, deviances, _ = play(x, P, arrivals + shift, offset_unknown=1)
        results.append((codes, deviances, np.delete(x, 4), P))
    for here, shifted in zip(*results, strict=True):
        assert here == pytest.approx(shifted, rel=1e-6, abs=1e-6)


def test_a_round_ahead_of_the_state_is_taken_as_by_a_state_predicted_to_it():
    ranges = distances(ROOM, (8.2, 6.1, 1.0))
    (x, P), (other_x, other_P) = state(7, 2, len(ROOM)), state(7, 2, len(ROOM))
    kernel.predict(other_x, other_P, 2, 5, 0.1, NOISE)
    for here, there in zip(play(x, P, ranges), play(other_x, other_P, ranges, ahead_s=0.0), strict=True):
        assert here.tolist() == there.tolist()
    assert (x.tolist(), P.tolist()) == (other_x.tolist(), other_P.tolist())
    assert x.tolist() != state(7, 2, len(ROOM))[0].tolist()


def test_a_common_shift_of_ranges_that_are_no_arrivals_is_noticed():
    x, P = state(4, 2, len(ROOM))
    assert (play(x, P, distances(ROOM, (*x[:2], 1.0)) - 9.0)[0] != kernel.ACCEPTED).all()


def test_the_quality_of_a_round_counts_what_was_accepted():
    x, P = state(5, 2, len(ROOM))
    x[4:] = 0.0
    P *= 0.1
    ranges = distances(ROOM, (*x[:2], 1.0))
    ranges[2] -= 45.0
    codes, _, (used, rms, dilution, short, holding) = play(x, P, ranges)
    assert codes.tolist() == [kernel.ACCEPTED] * 2 + [kernel.IMPOSSIBLE] + [kernel.ACCEPTED] * 3
    assert (used, short, holding) == (5, 1, 5)
    assert rms < 0.1
    assert 0.5 < dilution < 2.0


def test_a_round_of_nothing_is_a_prediction_with_no_quality():
    x, P = state(6, 2, 2)
    expected = van_loan(2, 2, 0.1)[0] @ x
    _, _, (used, rms, dilution, *_) = play(x, P, [])
    assert x == pytest.approx(expected)
    assert (used, dilution) == (0, math.inf)
    assert math.isnan(rms)


def test_belief_in_an_obstruction_fades_to_the_share_of_obstructed_links_while_the_link_is_not_heard():
    x, P = state(7, 2, len(ROOM))
    link_nlos = np.full(len(ROOM), 0.97)
    for _ in range(50):
        play(x, P, distances(ROOM[:2], (*x[:2], 1.0)), link_nlos=link_nlos)
    assert link_nlos[2:] == pytest.approx(SETTINGS.nlos_share, abs=0.01)


@pytest.mark.parametrize(("los", "low", "high"), [(0.0, 0.97, 0.97), (1.0, 0.01, 0.01), (0.5, 0.5, 0.5)])
def test_a_judgement_of_the_link_shifts_the_belief_within_its_bounds(los, low, high):
    assert low <= tracker_round._shifted(0.5, los, 1.0) <= high


def test_no_judgement_leaves_the_belief():
    assert tracker_round._shifted(0.3, math.nan, 1.0) == 0.3
    assert tracker_round._shifted(0.3, 0.8, 1.0) == pytest.approx(0.3 * 0.2 / (0.3 * 0.2 + 0.7 * 0.8))


def test_odds_of_a_judgement_count_by_their_weight():
    odds = [tracker_round._shifted(0.5, 0.8, weight) for weight in (0.0, 0.5, 1.0)]
    assert [value / (1.0 - value) for value in odds] == pytest.approx([1.0, 0.5, 0.25])
