"""Our tracker, seen from outside: where it says the tag is, how sure it is, and what it says of every range."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from uwb_scenes import LINE, PERIOD_S, ROOM, Tag, Track, distances, is_covariance, measurements, sd_m, tracked

from mine_loc_core.verdicts import Reason
from mine_loc_uwb.fix import FixStatus
from mine_loc_uwb.robust_tracker import RobustTracker
from mine_loc_uwb.tracker_settings import RobustTrackerSettings

SEEDS = st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("space", [False, True])
def test_it_starts_from_one_round_and_follows_a_walk(space):
    track = Track(Tag(1, velocity_m_s=(1.0, 0.4, 0.0), start_m=(4.0, 4.0, 1.2), space=space))
    first = track.round()
    assert first.fix.status is FixStatus.OK
    assert set(first.reasons) == {Reason.ACCEPTED}
    errors = [track.error_m(track.round()) for _ in range(80)]
    assert np.mean(errors[10:]) < (0.25 if space else 0.06)


def test_a_fix_says_how_it_fits_and_how_its_anchors_stand():
    track = Track(Tag(2))
    for solution in (track.round(), track.round()):
        assert solution.fix.ranges_used == len(ROOM)
        assert 0.0 < solution.fix.residual_rms_m < 0.2
        assert 0.5 < solution.fix.gdop < 2.0


@pytest.mark.parametrize(("heard", "reason"), [(0, None), (1, Reason.NOT_INITIALISED)])
def test_too_few_ranges_start_nothing(heard, reason):
    solution = Track(Tag()).round(only=range(heard))
    assert solution.fix.status is FixStatus.TOO_FEW_RANGES
    assert np.isnan(solution.fix.position_m).all()
    assert solution.reasons == (reason,) * heard


# Geometry.


@settings(max_examples=20)
@given(SEEDS, st.integers(0, 9), st.booleans())
def test_any_anchors_with_any_dropouts_give_a_finite_fix_or_say_why_not(seed, count, space):
    rng = np.random.default_rng(seed)
    anchors = rng.uniform([0, 0, 0], [40, 40, 6], (count, 3))
    track = Track(Tag(seed, anchors=anchors, start_m=(*rng.uniform(0, 40, 2), 1.2), space=space))
    for _ in range(30):
        solution = track.round(only=np.flatnonzero(rng.random(count) < 0.7).tolist())
        accepted = solution.reasons.count(Reason.ACCEPTED)
        if solution.fix.status is FixStatus.OK:
            assert np.isfinite(solution.fix.position_m).all()
            assert is_covariance(solution.fix.covariance_m2)
            assert solution.fix.ranges_used == accepted
        else:
            assert np.isnan(solution.fix.position_m).all()
            assert set(solution.reasons) <= {Reason.NOT_INITIALISED, Reason.DEGENERATE}


@pytest.mark.parametrize("aside_m", [2.0, 3.0, 8.0, 20.0])
def test_anchors_on_a_line_span_both_mirror_images_or_are_degenerate(aside_m):
    track = Track(Tag(3, anchors=LINE, start_m=(22.0, aside_m, 1.0)))
    first = track.round()
    if aside_m > RobustTrackerSettings().max_start_sd_m:
        assert first.fix.status is FixStatus.DEGENERATE
        assert set(first.reasons) == {Reason.DEGENERATE}
        return
    assert set(first.reasons) == {Reason.ACCEPTED}
    for solution in (first, track.play(5.0)):
        for image_m in (aside_m, -aside_m):
            off = np.array([22.0, image_m]) - solution.fix.position_m[:2]
            assert off @ np.linalg.solve(solution.fix.covariance_m2[:2, :2], off) < 6.0


def test_a_tag_passing_right_below_an_anchor_is_followed():
    anchors = np.vstack([ROOM, [8.0, 6.0, 1.5]])
    track = Track(Tag(4, anchors=anchors, start_m=(5.0, 6.0, 1.0), velocity_m_s=(1.0, 0.0, 0.0)))
    track.play(1.0)
    assert max(track.error_m(track.round()) for _ in range(50)) < 0.25


def test_more_links_than_are_remembered_are_used_all_the_same():
    angle = np.linspace(0.0, math.tau, 24, endpoint=False)
    ring = np.column_stack([10.0 + 12.0 * np.cos(angle), 8.0 + 12.0 * np.sin(angle), np.full(24, 2.5)])
    track = Track(Tag(5, anchors=ring, velocity_m_s=(0.5, 0.2, 0.0)))
    for number in range(60):
        heard = range(24) if number % 3 else range(number % 20, 24)
        solution = track.round(only=heard)
        assert is_covariance(solution.fix.covariance_m2)
        assert solution.fix.ranges_used > 0.7 * len(heard)
        assert track.error_m(solution) < 0.2
    assert len(track.tracker._slot) == 16


# Bad ranges.


@pytest.mark.parametrize("place", range(len(ROOM)))
@pytest.mark.parametrize(
    ("wrong_m", "wanted"), [(-45.0, Reason.KINEMATIC), (-3.0, Reason.KINEMATIC), (60.0, Reason.GATE)]
)
def test_an_outlier_is_refused_and_does_not_move_the_position(place, wrong_m, wanted):
    clean, spoilt = tracked(6), tracked(6)
    there, here = clean.round(), spoilt.round(excess={place: wrong_m})
    assert here.reasons[place] is wanted
    assert here.mahalanobis_sq[place] > here.gate
    assert here.reasons.count(Reason.ACCEPTED) == here.fix.ranges_used == len(ROOM) - 1
    assert np.linalg.norm(here.fix.position_m - there.fix.position_m) < 0.05


@pytest.mark.parametrize("excess_m", [0.5, 1.5, 3.0])
def test_an_obstructed_link_is_used_and_hardly_moves_the_position(excess_m):
    track = tracked(7)
    for _ in range(30):
        solution = track.round(excess={0: excess_m, 3: excess_m})
        assert track.error_m(solution) < 0.2
    assert solution.reasons[1] is Reason.ACCEPTED


def test_a_late_range_moves_the_position_less_on_a_link_told_to_be_obstructed_than_on_one_told_to_be_clear():
    def moved_m(los_probability: float) -> float:
        fixes = []
        for excess_m in (0.0, 0.35):
            track = tracked(8)
            late = track.tag.round(track.at_s + PERIOD_S, excess={0: excess_m})
            late.los_probability[0] = los_probability
            fixes.append(track.tracker.solve(late).fix.position_m)
        return float(np.linalg.norm(fixes[1] - fixes[0]))

    assert 1.2 * moved_m(0.05) < moved_m(math.nan) < moved_m(0.95)


# Few ranges, silence.


@pytest.mark.parametrize("heard", [[], [4]])
def test_one_anchor_or_none_lets_the_covariance_grow(heard):
    track = tracked(9, velocity_m_s=(0.6, 0.2, 0.0))
    spreads = [sd_m(track.round(only=heard).fix)]
    for _ in range(5):
        solution = track.play(2.0, only=heard)
        assert solution.fix.status is FixStatus.OK
        assert solution.fix.ranges_used == len(heard)
        assert track.error_m(solution) < 3.0 * sd_m(solution.fix)
        spreads.append(sd_m(solution.fix))
    assert (np.diff(spreads) > 0.0).all()
    assert spreads[-1] > 2.0


@pytest.mark.parametrize("heard", [[], [4], [0, 1]])
@pytest.mark.parametrize("seconds", [2.0, 7.0, 15.0, 40.0])
def test_after_few_ranges_a_full_round_finds_the_tag_again(heard, seconds):
    track = tracked(10, velocity_m_s=(0.1, 0.05, 0.0))
    track.play(seconds, only=heard)
    assert track.error_m(track.play(1.0)) < 0.2


@pytest.mark.parametrize("seconds", [5.0, 10.0, 15.0])
@pytest.mark.parametrize("anchor", [0, 4])
def test_after_a_walk_with_one_anchor_no_wrong_place_that_some_ranges_fit_is_held(anchor, seconds):
    for seed in range(8):
        track = tracked(seed, start_m=(6.0 + seed % 7, 5.0 + seed % 5, 1.0))
        track.play(seconds, only=[anchor])
        track.tag._start[:2] += [3.0, 4.0]
        assert track.error_m(track.play(1.0)) < 0.3


@pytest.mark.parametrize("seconds", [1.0, 5.0, 15.0, 20.0, 25.0, 29.0, 31.0, 300.0])
@pytest.mark.parametrize("speed_m_s", [0.0, 0.4])
def test_after_a_silence_no_jump_is_claimed_as_certain(seconds, speed_m_s):
    track = tracked(11)
    track.silence(seconds)
    track.tag._start[0] += speed_m_s * min(seconds, 15.0)
    first = track.round()
    assert first.fix.status is FixStatus.OK
    assert track.error_m(first) < 3.0 * sd_m(first.fix)
    assert track.error_m(track.play(1.0)) < 0.2


def test_after_thirty_seconds_of_silence_nothing_of_the_old_state_counts():
    track = tracked(12)
    track.silence(31.0)
    few = track.round(only=[0])
    assert few.fix.status is FixStatus.TOO_FEW_RANGES
    assert few.reasons == (Reason.NOT_INITIALISED,)
    assert set(track.round().reasons) == {Reason.ACCEPTED}


# Consistency.


def test_the_covariance_stays_one_over_a_long_walk():
    track = Track(Tag(16, velocity_m_s=(0.005, 0.003, 0.0)))
    for _ in range(2000):
        solution = track.round()
    assert is_covariance(solution.fix.covariance_m2)
    assert np.allclose(track.tracker.P, track.tracker.P.T, rtol=1e-9, atol=1e-12)
    assert np.linalg.eigvalsh(track.tracker.P)[0] > 0.0


def walk_by_its_own_model(seed: int, rounds: int) -> tuple[float, float]:
    """NEES a coordinate and error [m] at the end of a walk whose motion, biases and obstructions are the settings'."""
    s, rng, count = RobustTrackerSettings(), np.random.default_rng(seed), len(ROOM)
    position, velocity = np.array([*rng.uniform([5, 4], [15, 11]), 1.2]), np.array([*rng.normal(0.0, 0.6, 2), 0.0])
    biases = rng.normal(0.0, s.common_bias_sd_m) + rng.normal(0.0, s.bias_sd_m, count)
    excess = (rng.random(count) < s.nlos_share) * rng.exponential(s.nlos_scale_m, count)
    tracker = RobustTracker(s)
    for number in range(rounds):
        change = rng.normal(0.0, math.sqrt(s.acceleration_density_m2_s3 * PERIOD_S), 2)
        position[:2] += PERIOD_S * (velocity[:2] + change / 2.0)
        velocity[:2] += change
        drawn_anew = rng.random(count) < 1.0 - math.exp(-PERIOD_S / s.nlos_time_s)
        fresh = (rng.random(count) < s.nlos_share) * rng.exponential(s.nlos_scale_m, count)
        excess = np.where(drawn_anew, fresh, excess)
        ranges = distances(ROOM, position) + biases + excess + rng.normal(0.0, 0.05, count)
        fix = tracker.solve(measurements(number * PERIOD_S, ROOM, ranges, height_m=1.2, sd_m=0.05)).fix
    error = (fix.position_m - position)[:2]
    return error @ np.linalg.solve(fix.covariance_m2[:2, :2], error) / 2.0, float(np.linalg.norm(error))


def test_on_its_own_model_it_errs_as_much_as_it_says_and_no_more_than_that_can_be():
    """Half of all links are late by 0.6 m on average, for a second. The bound on the error forbids inflation."""
    nees, errors_m = np.transpose([walk_by_its_own_model(seed, 50) for seed in range(150)])
    assert 0.7 < nees.mean() < 1.4
    assert np.median(errors_m) < 0.08


def test_what_is_claimed_across_a_line_of_anchors_is_as_poor_as_it_is_known():
    """Systematic errors of links do not average out: they go through the geometry, as a short baseline makes them."""
    line = np.array([[0.0, 0.0, 2.4], [25.0, 0.6, 2.4], [50.0, -0.6, 2.4], [75.0, 0.0, 2.4]])
    track = Track(Tag(18, anchors=line, start_m=(37.0, 2.0, 1.0)))
    solution = track.play(5.0)
    along_m, across_m = np.sqrt(np.diag(solution.fix.covariance_m2)[:2])
    assert along_m < 0.3
    assert across_m > 4.0 * along_m


def test_a_place_that_ranges_are_too_short_for_is_left_though_most_ranges_are_taken_for_obstructed():
    """Two clear ranges and one from round a corner, from a place that only the last one fits: example_mine's branch."""
    anchors = np.array([[45.0, -1.8, 2.4], [43.2, 20.0, 2.4], [25.0, -1.8, 2.4], [70.0, 1.8, 2.4]])
    track, wrong = Track(Tag(19, anchors=anchors, start_m=(45.0, 4.0, 1.0))), (50.0, -6.0, 1.0)
    track.tracker.solve(measurements(0.0, anchors, distances(anchors, wrong), height_m=1.0))
    for _ in range(60):
        solution = track.round(only=[0, 1, 2], excess={2: 5.9})
    assert track.error_m(solution) < 2.0 * sd_m(solution.fix)
    assert track.error_m(solution) < 4.0
