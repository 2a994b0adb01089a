"""The default fusion: how it starts, what it learns by walking, what it carries through, what it refuses."""

import math

import numpy as np
import pytest
from garbage import Garbage
from hypothesis import example, given, settings
from hypothesis import strategies as st
from subjects import own, reasons, state_bytes, walked
from walks import HALL, HEIGHT_M, T0, Walk, at, is_covariance, place_fix, position_fix, ranges_to, step_fix

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_core.verdicts import Reason, Source
from mine_loc_fusion.estimate import EpochInputs, PlaceFix, PositionFix, StepFix
from mine_loc_fusion.late_inputs import LateInputCorrector
from mine_loc_fusion.step_kernel import SCALE, YAW
from mine_loc_fusion.tightly_coupled import TightlyCoupled

SEEDS = st.integers(0, 2**32 - 1)


# Starting.


def test_before_anything_there_is_no_estimate_and_a_step_makes_none():
    subject = TightlyCoupled()
    assert reasons(subject.update(EpochInputs(T0, steps=(step_fix(),)))) == [Reason.NOT_INITIALISED]
    assert subject.estimate(T0) is None


def test_one_round_of_ranges_starts_it_where_they_meet():
    subject = TightlyCoupled()
    verdicts = subject.update(EpochInputs(T0, ranges=(ranges_to((8.0, 6.0), T0),)))
    assert [(v.source, v.sensor_id, v.reason) for v in verdicts] == [
        (Source.RANGE, anchor, Reason.ACCEPTED) for anchor in range(1, len(HALL) + 1)
    ]
    estimate = subject.estimate(T0)
    assert estimate.position_m == pytest.approx([8.0, 6.0], abs=0.05)
    assert estimate.velocity_ms == pytest.approx([0.0, 0.0])
    assert (estimate.since_uwb_s, estimate.since_step_s, estimate.yaw_offset_rad) == (0.0, math.inf, None)
    assert estimate.height_m is None


@pytest.mark.parametrize(
    ("what", "since_uwb_s", "since_region_s"),
    [
        ({"positions": (position_fix(8.0, 6.0, 1.0),)}, 0.0, math.inf),
        ({"places": (place_fix(8.0, 6.0, 1.0),)}, math.inf, math.inf),
        ({"places": (place_fix(8.0, 6.0, 1.0, Source.REGION),)}, math.inf, 0.0),
    ],
)
def test_a_position_a_landmark_or_a_region_starts_it_as_sure_as_they_are(what, since_uwb_s, since_region_s):
    subject = TightlyCoupled()
    assert reasons(subject.update(EpochInputs(T0, **what))) == [Reason.ACCEPTED]
    estimate = subject.estimate(T0)
    assert estimate.position_m.tolist() == [8.0, 6.0]
    assert np.sqrt(np.diag(estimate.covariance)[:2]) == pytest.approx(1.0, rel=0.01)
    assert (estimate.since_uwb_s, estimate.since_region_s) == (since_uwb_s, since_region_s)


def test_ranges_take_over_from_a_region_far_from_the_truth():
    subject, walk = TightlyCoupled(), Walk()
    region = place_fix(*(walk.place_m + np.array([12.0, 8.0])), 8.0, Source.REGION)
    subject.update(EpochInputs(walk.stamp_ns, places=(region,)))
    errors = walk.play(subject, 5.0)
    assert errors[20:].max() < 0.2


def test_who_is_told_to_be_somewhere_with_a_yaw_has_it():
    subject = TightlyCoupled()
    subject.begin(T0, np.array([1.0, 2.0]), 0.25 * np.eye(2), (0.3, 0.01))
    estimate = subject.estimate(T0)
    assert estimate.position_m.tolist() == [1.0, 2.0]
    assert estimate.yaw_offset_rad == pytest.approx(0.3)
    assert own(subject, YAW) == pytest.approx((0.3, 0.1))


# What walking teaches.


@pytest.mark.parametrize("yaw_rad", [0.0, 0.7, -2.0, 3.1])
def test_the_yaw_of_the_odom_frame_is_found_by_walking_within_what_is_claimed(yaw_rad):
    subject, _ = walked(40.0, yaw_rad=yaw_rad)
    found, sd_rad = own(subject, YAW)
    error_rad = abs(math.remainder(found - yaw_rad, math.tau))
    assert subject.estimate(at(40.0)).yaw_offset_rad == found
    assert error_rad < 0.05
    assert error_rad < 3.0 * sd_rad


@pytest.mark.parametrize("step_scale", [0.95, 1.05])
def test_steps_told_five_percent_wrong_are_found_out_by_walking_with_ranges(step_scale):
    subject, _ = walked(120.0, step_scale=step_scale)
    found, sd = own(subject, SCALE)
    wanted = 1.0 / step_scale - 1.0
    assert abs(found - wanted) < 0.025
    assert abs(found - wanted) < 3.0 * sd
    assert sd < 0.4 * TightlyCoupled()._s.scale_sd


def test_steps_make_a_walk_with_ranges_no_worse_and_one_without_much_better():
    errors = {}
    for steps in (True, False):
        subject, walk = TightlyCoupled(), Walk()
        with_ranges = walk.play(subject, 40.0, steps=steps)[50:]
        errors[steps] = with_ranges.mean(), walk.play(subject, 10.0, ranges=False, steps=steps)[-1]
    assert errors[True][0] < min(1.1 * errors[False][0], 0.06)
    assert errors[True][1] < 0.2 * errors[False][1]


def test_positions_alone_do_where_there_are_no_ranges():
    subject, walk = TightlyCoupled(), Walk()
    errors = walk.play(subject, 40.0, ranges=False, positions=True)
    assert errors[100:].mean() < 0.15
    assert subject.estimate(walk.stamp_ns).yaw_offset_rad == pytest.approx(walk.yaw_rad, abs=0.1)


def test_a_place_tells_where_a_person_is_who_has_only_steps():
    subject, walk = walked()
    walk.play(subject, 60.0, ranges=False)
    before = np.trace(subject.estimate(walk.stamp_ns).covariance[:2, :2])
    (verdict,) = subject.update(EpochInputs(walk.stamp_ns, places=(place_fix(*walk.place_m, 0.2),)))
    assert (verdict.source, verdict.reason, verdict.degrees_of_freedom) == (Source.LANDMARK, Reason.ACCEPTED, 2)
    assert walk.error_m(subject) < 0.3
    assert np.trace(subject.estimate(walk.stamp_ns).covariance[:2, :2]) < 0.2 * before


# Being without ranges, and with bad ones.


@pytest.mark.parametrize("seed", range(4))
def test_a_minute_on_steps_costs_less_than_two_percent_of_the_way_and_ends_within_two_rounds(seed):
    subject, walk = walked(60.0, seed=seed)
    errors = walk.play(subject, 60.0, ranges=False)  # 72 m
    estimate = subject.estimate(walk.stamp_ns)
    assert errors.max() < 1.44
    assert estimate.since_uwb_s == pytest.approx(60.0)
    assert errors[-1] < 3.0 * math.sqrt(np.trace(estimate.covariance[:2, :2]))
    assert walk.play(subject, 2.0)[2:].max() < 0.3


def test_a_sharp_corner_on_steps_alone_loses_no_step():
    subject, walk = walked(60.0, radius_m=0.3)
    verdicts = [verdict for _ in range(600) for verdict in subject.update(walk.next(ranges=False))]
    assert set(reasons(verdicts)) == {Reason.ACCEPTED}


def test_without_any_input_the_spread_grows_and_ranges_find_the_person_again_at_once():
    subject, walk = walked()
    spreads = [np.trace(subject.estimate(walk.stamp_ns + s * NS_PER_S).covariance[:2, :2]) for s in range(60)]
    assert (np.diff(spreads) > 0.0).all()
    for _ in range(600):
        walk.next()
    assert walk.play(subject, 3.0)[10:].max() < 0.3


@pytest.mark.parametrize("silence_s", [3600, 7 * 86_400])
@pytest.mark.parametrize("positions", [False, True])
def test_after_an_hour_or_a_week_the_person_is_found_within_seconds(silence_s, positions):
    subject, walk = TightlyCoupled(), Walk()
    kind = {"positions": True, "ranges": False} if positions else {}
    walk.play(subject, 20.0, **kind)
    walk.number += silence_s * 10
    walk.next()
    assert walk.play(subject, 5.0, **kind)[30:].max() < 0.5
    assert is_covariance(subject._tracker.P)


def standing_error_m(seed, yaw):
    """Root mean square over half a minute on the spot, while what is left over of each range wanders within seconds."""
    rng, subject = np.random.default_rng(seed), TightlyCoupled()
    at_m, left_m, squares = np.array([5.0, 5.0]), np.zeros(len(HALL)), []
    subject.begin(T0, at_m, 0.01 * np.eye(2), yaw)
    for number in range(1, 300):
        left_m = 0.95 * left_m + 0.03 * rng.normal(size=len(HALL))
        subject.update(EpochInputs(at(0.1 * number), ranges=(ranges_to(at_m, at(0.1 * number), noise_m=left_m),)))
        squares.append(np.sum((subject.estimate(at(0.1 * number)).position_m - at_m) ** 2))
    return math.sqrt(np.mean(squares))


def test_who_stands_with_a_known_yaw_is_not_dragged_about_by_what_is_left_over_of_ranges():
    errors = np.array([[standing_error_m(seed, yaw) for yaw in ((0.0, 0.01), None)] for seed in range(8)])
    known, unknown = np.sqrt(np.mean(errors**2, axis=0))
    assert known < 0.9 * unknown


@pytest.mark.parametrize("excess_m", [1.0, 3.0, 20.0])
@pytest.mark.parametrize("who", [(0,), (1, 2)])
def test_a_burst_of_long_ranges_hardly_moves_the_person(excess_m, who):
    subject, walk = walked()
    excess = np.where(np.isin(np.arange(len(HALL)), who), excess_m, 0.0)
    assert walk.play(subject, 5.0, excess_m=excess).max() < 0.4
    assert walk.play(subject, 3.0)[10:].max() < 0.2


def test_while_all_ranges_are_long_steps_hold_the_person():
    subject, walk = walked()
    assert walk.play(subject, 5.0, excess_m=3.0).max() < 0.5


def test_a_range_that_nothing_explains_is_refused_by_its_gate_and_not_used():
    subject, walk = walked()
    before = subject.save()
    clean = walk.next()
    excess = np.where(np.arange(len(HALL)) == 2, 60.0, 0.0)
    spoilt = EpochInputs(
        clean.stamp_ns, ranges=(ranges_to(walk.place_m, clean.stamp_ns, excess_m=excess),), steps=clean.steps
    )
    verdicts = subject.update(spoilt)
    assert reasons(verdicts)[2] is Reason.GATE
    assert verdicts[2].mahalanobis_sq > verdicts[2].threshold
    spoilt_m = subject.estimate(clean.stamp_ns).position_m
    subject.restore(before)
    subject.update(EpochInputs(clean.stamp_ns, ranges=(ranges_to(walk.place_m, clean.stamp_ns),), steps=clean.steps))
    assert spoilt_m == pytest.approx(subject.estimate(clean.stamp_ns).position_m, abs=0.05)


def test_positions_beside_ranges_are_duplicates_and_change_nothing():
    subject, walk = walked()
    epoch = walk.next()
    subject.update(epoch)
    before = state_bytes(subject)
    far = position_fix(*(walk.place_m + 5.0))
    (verdict,) = subject.update(EpochInputs(epoch.stamp_ns, positions=(far,)))
    assert (verdict.source, verdict.reason) == (Source.UWB_POSE, Reason.DUPLICATE)
    assert state_bytes(subject) == before


def test_positions_count_when_ranges_have_been_silent_for_a_second():
    subject, walk = walked()
    taken = []
    for _ in range(11):
        epoch = walk.next(ranges=False, positions=True)
        taken += [v.reason for v in subject.update(epoch) if v.source is Source.UWB_POSE]
    assert taken == [Reason.DUPLICATE] * 9 + [Reason.ACCEPTED] * 2


def test_positions_that_are_refused_for_long_are_believed_in_the_end():
    subject, walk = TightlyCoupled(), Walk()
    walk.play(subject, 20.0, ranges=False, positions=True)
    taken = []
    for number in range(40):
        stamp_ns = walk.stamp_ns + (number + 1) * 100 * NS_PER_MS
        taken += reasons(subject.update(EpochInputs(stamp_ns, positions=(position_fix(60.0, 60.0),))))
    assert taken[0] is Reason.GATE
    assert set(taken) == {Reason.GATE, Reason.ACCEPTED}
    first = taken.index(Reason.ACCEPTED)
    assert first * 0.1 == pytest.approx(subject._s.alone.reopen_after_s, abs=0.11)
    assert set(taken[first:]) == {Reason.ACCEPTED}
    assert subject.estimate(stamp_ns).position_m == pytest.approx([60.0, 60.0], abs=0.2)


def test_a_place_too_far_away_is_refused_by_the_gate_with_its_figures():
    subject, walk = walked()
    before = subject._tracker.x.copy()
    (verdict,) = subject.update(
        EpochInputs(walk.stamp_ns, places=(place_fix(*(walk.place_m + np.array([9.0, 0.0])), 0.5),))
    )
    assert (verdict.source, verdict.reason) == (Source.LANDMARK, Reason.GATE)
    assert verdict.mahalanobis_sq > verdict.threshold
    assert verdict.innovation == pytest.approx(9.0, abs=0.3)
    assert np.array_equal(subject._tracker.x, before)


@pytest.mark.parametrize(
    "bad",
    [
        {"positions": (position_fix(math.nan, 0.0),)},
        {"positions": (position_fix(1e300, 0.0),)},
        {"positions": (PositionFix(np.zeros(2), -np.eye(2)),)},
        {"places": (place_fix(0.0, math.inf),)},
        {"places": (PlaceFix(Source.REGION, np.zeros(2), np.zeros((2, 2))),)},
        {"places": (PlaceFix(Source.LANDMARK, np.zeros(2), np.full((2, 2), math.nan)),)},
        {"steps": (step_fix(length_m=-0.1),)},
        {"steps": (step_fix(length_m=math.nan),)},
        {"steps": (step_fix(heading_rad=math.inf),)},
        {"steps": (StepFix(0.6, math.nan, 0.0, 0.01, 0.5),)},
    ],
)
def test_what_is_impossible_is_invalid_and_changes_nothing(bad):
    subject, walk = walked()
    subject._ranges_ns = None  # so that a position is looked at
    before = state_bytes(subject)
    assert reasons(subject.update(EpochInputs(walk.stamp_ns, **bad))) == [Reason.INVALID]
    assert state_bytes(subject) == before


@pytest.mark.parametrize("spread_m2", [5e-324, 1e-300, 1e-12])
def test_places_that_claim_to_be_exact_leave_a_covariance(spread_m2):
    subject = TightlyCoupled()
    exact = PlaceFix(Source.LANDMARK, np.array([1.0, 2.0]), spread_m2 * np.eye(2))
    for _ in range(3):
        assert reasons(subject.update(EpochInputs(T0, places=(exact,)))) == [Reason.ACCEPTED]
    covariance = subject.estimate(T0).covariance
    assert is_covariance(covariance)
    assert 0.0 < covariance[0, 0] < 0.01**2


def test_a_place_whose_covariance_is_not_symmetric_counts_as_the_mean_of_both_halves():
    estimates = []
    for halves in ((0.3, -0.1), (0.1, 0.1)):
        subject, walk = walked(5.0)
        spread_m2 = np.array([[0.5, halves[0]], [halves[1], 0.4]])
        subject.update(EpochInputs(walk.stamp_ns, places=(PlaceFix(Source.LANDMARK, walk.place_m + 0.5, spread_m2),)))
        estimates.append(subject.estimate(walk.stamp_ns))
    assert estimates[0].position_m == pytest.approx(estimates[1].position_m)
    assert estimates[0].covariance == pytest.approx(estimates[1].covariance)


@pytest.mark.parametrize("space", [False, True])
@settings(max_examples=60)
@given(seed=SEEDS, known=st.booleans())
@example(seed=10_472, known=False)
@example(seed=251_875, known=True)  # an exact place after a spread of kilometres
def test_whatever_it_is_told_the_estimate_is_finite_and_its_covariance_one(space, seed, known):
    subject, walk = TightlyCoupled(height_m=HEIGHT_M if space else None), Walk(space=space)
    walk.play(subject, 10.0 if known else 0.0)
    garbage = Garbage(seed, space=space, start_ns=walk.stamp_ns)
    for _ in range(30):
        epoch = garbage.epoch()
        verdicts = subject.update(epoch)
        others = (epoch.positions, epoch.steps, epoch.places, epoch.velocity_changes)
        assert len(verdicts) == sum(len(each) for each in (*others, *epoch.ranges))
        for later_ns in (0, NS_PER_S):
            estimate = subject.estimate(epoch.stamp_ns + later_ns)
            if estimate is None:
                assert Reason.ACCEPTED not in reasons(verdicts)
                continue
            assert np.isfinite(estimate.position_m).all()
            assert np.isfinite(estimate.velocity_ms).all()
            assert is_covariance(estimate.covariance)


# Saving, restoring, and steps that come late.


@pytest.mark.parametrize("seconds", [0.0, 0.3, 2.0, 20.0])
def test_what_is_restored_goes_on_to_the_same_bytes(seconds):
    subject, walk = walked(seconds)
    saved, epochs = subject.save(), [walk.next() for _ in range(100)]
    at_first = state_bytes(subject)
    ends = []
    for _ in range(3):
        for epoch in epochs:
            subject.update(epoch)
        ends.append(state_bytes(subject))
        subject.restore(saved)
        assert state_bytes(subject) == at_first
    assert ends[0] == ends[1] == ends[2] != at_first


@pytest.mark.parametrize("late_epochs", [1, 5, 19])
def test_late_steps_end_where_steps_on_time_do(late_epochs):
    prompt, late = (LateInputCorrector(TightlyCoupled(), 2 * NS_PER_S) for _ in range(2))
    walk, waiting = Walk(), []
    for number in range(400):
        epoch = walk.next()
        rounds, steps = (
            EpochInputs(epoch.stamp_ns, ranges=epoch.ranges),
            EpochInputs(epoch.stamp_ns, steps=epoch.steps),
        )
        prompt.update(rounds)
        late.update(rounds)
        if epoch.steps:
            prompt.update(steps)
            waiting.append((number + late_epochs, steps))
        while waiting and waiting[0][0] <= number:
            late.update(waiting.pop(0)[1])
    for _, steps in waiting:
        late.update(steps)
    a, b = (each.estimate(walk.stamp_ns) for each in (prompt, late))
    assert a.yaw_offset_rad is not None
    assert b.position_m == pytest.approx(a.position_m, abs=1e-9)
    assert b.velocity_ms == pytest.approx(a.velocity_ms, abs=1e-9)
    assert b.covariance == pytest.approx(a.covariance, rel=1e-9, abs=1e-12)
    assert b.yaw_offset_rad == pytest.approx(a.yaw_offset_rad, abs=1e-9)


def test_where_heights_are_solved_for_it_tells_the_height():
    subject, walk = walked(20.0, subject=TightlyCoupled(height_m=2.0), space=True)
    estimate = subject.estimate(walk.stamp_ns)
    assert estimate.height_m == pytest.approx(HEIGHT_M, abs=0.15)
    assert walk.error_m(subject) < 0.15
    assert estimate.covariance.shape == (4, 4)


def test_in_space_a_place_starts_it_at_the_height_that_is_told():
    subject = TightlyCoupled(height_m=2.0)
    subject.update(EpochInputs(T0, places=(place_fix(5.0, 5.0),)))
    assert subject.estimate(T0).height_m == 2.0
    walk = Walk(space=True)
    walk.play(subject, 5.0)
    assert subject.estimate(walk.stamp_ns).height_m == pytest.approx(HEIGHT_M, abs=0.2)
