"""Measures of positioning, on tracks whose errors are known."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_bringup.evaluation.evaluation import evaluate
from mine_loc_bringup.evaluation.measures import Comparing, compare, measure
from mine_loc_bringup.evaluation.track import StepCount, Track, Truth
from mine_loc_core.alignment import Alignment
from mine_loc_fusion.mode import Mode

START_NS = 1_700_000_000 * 10**9
SECONDS = 40.0
TIMES_S = np.arange(0.0, SECONDS, 0.1)
SPAN_NS = (START_NS, START_NS + int(SECONDS * 1e9))


def path_m(times_s):
    return np.column_stack([4 * np.sin(0.5 * times_s) + 0.3 * times_s, 3 * np.cos(0.31 * times_s)])


def ns(times_s):
    return START_NS + np.round(np.asarray(times_s) * 1e9).astype(np.int64)


def track(position_m, *, times_s=TIMES_S, sd_m=0.3, ce95_m=0.75, mode=Mode.UWB_ONLY, latency_s=0.02):
    count = len(times_s)
    covariance = np.tile(sd_m**2 * np.eye(2), (count, 1, 1))
    modes = np.broadcast_to(np.asarray(mode, np.int64), (count,)).copy()
    stamps = ns(times_s)
    return Track(stamps, stamps + round(latency_s * 1e9), position_m, covariance, np.full(count, ce95_m), modes)


def truth(*, offset_s=0.0, transform=None, from_s=-1.0, to_s=SECONDS + 1.0, frame="map"):
    times_s = np.arange(from_s, to_s, 0.02)
    place = path_m(times_s)
    return Truth(ns(times_s + offset_s), transform.apply(place) if transform else place, frame)


def measured(of_track, of_truth, **comparing):
    return measure([compare("ann", of_track, of_truth, SPAN_NS, Comparing(**comparing))])


def shifted(x_m, y_m):
    return path_m(TIMES_S) + np.array([x_m, y_m])


def noisy(sd_m=0.3, seed=1, times_s=TIMES_S):
    return path_m(times_s) + np.random.default_rng(seed).normal(0.0, sd_m, (len(times_s), 2))


def test_a_known_error_is_reported_as_it_is():
    found = measured(track(shifted(0.3, 0.4)), truth())
    for name in ("horizontal_mean_m", "rmse_m", "median_m", "third_quartile_m", "ce95_m", "max_m"):
        assert getattr(found, name) == pytest.approx(0.5, abs=1e-3)
    assert found.nees_mean == pytest.approx(0.25 / 0.09, rel=0.01)
    assert found.claimed_ce95_holds == 1.0
    assert found.availability == found.availability_measured == pytest.approx(1.0, abs=0.005)
    assert (found.latency_p50_ms, found.latency_p99_ms) == (pytest.approx(20.0), pytest.approx(20.0))
    assert found.modes == {"UWB_ONLY": 1.0}


def test_an_honest_covariance_is_found_consistent_and_a_boast_is_not():
    honest = measured(track(noisy(0.3)), truth())
    assert honest.nees_low < honest.nees_mean < honest.nees_high
    assert honest.claimed_ce95_holds_low < 0.95 < honest.claimed_ce95_holds_high
    boast = measured(track(noisy(0.6), ce95_m=0.75), truth())
    assert boast.nees_mean > boast.nees_high
    assert boast.claimed_ce95_holds_high < 0.95


@settings(max_examples=15)
@given(yaw=st.floats(-3.1, 3.1), x=st.floats(-1e3, 1e3), y=st.floats(-1e3, 1e3), seed=st.integers(0, 1000))
def test_rigid_alignment_makes_the_frame_of_the_truth_irrelevant(yaw, x, y, seed):
    outputs = track(noisy(seed=seed))
    own = measured(outputs, truth(), rigid=True)
    other = measured(outputs, truth(transform=Alignment(0.0, yaw, np.array([x, y]))), rigid=True)
    for name in ("rmse_m", "ce95_m", "max_m", "nees_mean"):
        assert getattr(other, name) == pytest.approx(getattr(own, name), rel=1e-5)


@settings(max_examples=15)
@given(yaw=st.floats(-3.0, 3.0))
def test_without_alignment_another_frame_is_an_error(yaw):
    turned = truth(transform=Alignment(0.0, yaw, np.array([5.0, 0.0])))
    assert measured(track(path_m(TIMES_S)), turned).rmse_m > 1.0


@settings(max_examples=15)
@given(offset_s=st.floats(-8.0, 8.0), rigid=st.booleans(), seed=st.integers(0, 1000))
def test_the_time_offset_is_found_and_applied_only_on_request(offset_s, rigid, seed):
    outputs, late = track(noisy(0.05, seed)), truth(offset_s=offset_s, from_s=-10.0, to_s=SECONDS + 10.0)
    asis, applied = (measured(outputs, late, rigid=rigid, apply_time_offset=each) for each in (False, True))
    assert asis.time_offset_s == applied.time_offset_s == pytest.approx(offset_s, abs=0.03)
    assert applied.rmse_m == pytest.approx(0.07, abs=0.02)
    if abs(offset_s) > 0.5:
        assert asis.rmse_m > 3 * applied.rmse_m


def test_nobody_can_tell_the_time_offset_of_who_stands():
    place = np.tile([1.0, 2.0], (len(TIMES_S), 1))
    standing = Truth(ns(np.arange(0.0, SECONDS, 0.1)), np.tile([1.0, 2.0], (400, 1)))
    found = measured(track(place), standing, apply_time_offset=True)
    assert found.time_offset_s is None
    assert found.max_m == pytest.approx(0.0)


def test_an_offset_beyond_the_search_is_not_told():
    straight = Truth(ns(TIMES_S + 15.0), np.column_stack([TIMES_S, TIMES_S]))
    assert measured(track(np.column_stack([TIMES_S, TIMES_S])), straight).time_offset_s is None


def test_outputs_without_truth_are_not_scored_and_not_due():
    found = measured(track(shifted(0.3, 0.4), times_s=TIMES_S), truth(to_s=12.0))
    assert (found.outputs, found.scored) == (len(TIMES_S), pytest.approx(120, abs=1))
    silent = TIMES_S < 12.0
    half = measured(track(path_m(TIMES_S[silent]), times_s=TIMES_S[silent]), truth(to_s=12.0))
    assert half.availability == pytest.approx(1.0, abs=0.005)


def test_silence_lowers_availability():
    heard = (TIMES_S < 10.0) | (TIMES_S >= 20.0)
    found = measured(track(path_m(TIMES_S[heard]), times_s=TIMES_S[heard]), truth())
    assert found.availability == pytest.approx(1.0 - (10.1 - 0.5) / SECONDS, abs=0.01)
    assert found.longest_gap_s == pytest.approx(10.1)


def test_who_is_lost_is_not_there_and_who_coasts_is_not_measured():
    mode = np.where(TIMES_S < 10.0, Mode.COASTING, np.where(TIMES_S < 20.0, Mode.LOST, Mode.UWB_PDR))
    places = path_m(TIMES_S) + np.where(mode[:, None] == Mode.LOST, 100.0, 0.0)
    found = measured(track(places, mode=mode), truth())
    assert found.availability == pytest.approx(0.75, abs=0.02)
    assert found.availability_measured == pytest.approx(0.5, abs=0.02)
    assert found.max_m < 0.01  # a place that is said to be lost is not scored
    assert found.modes == {
        "COASTING": pytest.approx(0.25, abs=0.01),
        "LOST": pytest.approx(0.25, abs=0.01),
        "UWB_PDR": pytest.approx(0.5, abs=0.01),
    }


def test_what_is_no_number_and_what_went_back_is_counted():
    places = path_m(TIMES_S)
    places[5] = np.nan
    outputs = track(places)
    outputs.stamp_ns[50] -= 10**9
    found = measured(outputs, truth())
    assert (found.not_finite, found.backward_stamps) == (1, 1)
    assert found.scored == len(TIMES_S) - 1


@pytest.mark.parametrize(("claimed_m", "holds"), [(np.nan, 0.0), (np.inf, 1.0)])
def test_a_claim_that_is_no_number_is_judged_and_not_reported(claimed_m, holds):
    found = measured(track(path_m(TIMES_S), ce95_m=claimed_m), truth())
    assert found.claimed_ce95_m is None
    assert found.claimed_ce95_holds == holds


def test_people_are_pooled_and_their_availability_is_the_mean():
    near = compare("ann", track(shifted(1.0, 0.0)), truth(), SPAN_NS, Comparing())
    far = compare("bob", track(shifted(3.0, 0.0)), truth(), SPAN_NS, Comparing())
    nobody = compare("cid", track(np.empty((0, 2)), times_s=np.empty(0)), truth(), SPAN_NS, Comparing())
    found = measure([near, far, nobody])
    assert found.horizontal_mean_m == pytest.approx(2.0, abs=1e-3)
    assert found.availability == pytest.approx(2 / 3, abs=0.005)
    assert found.scored == 2 * len(TIMES_S)
    assert found.time_offset_s is None


def test_steps_are_counted():
    compared = compare("ann", track(path_m(TIMES_S)), None, SPAN_NS, Comparing(), StepCount(true=40, found=38))
    found = measure([compared])
    assert (found.steps_true, found.steps_found, found.step_count_error) == (40, 38, pytest.approx(-0.05))
    assert found.horizontal_mean_m is None
    assert found.availability == pytest.approx(1.0, abs=0.005)


def test_what_could_not_be_measured_is_said():
    outputs = {"ann": track(path_m(TIMES_S)), "bob": track(path_m(TIMES_S))}
    truths = {"bob": truth(frame="vicon"), "cid": truth()}
    found = evaluate(outputs, truths, {}, {}, SPAN_NS, Comparing(), "map")
    assert [note.split(":")[0] for note in found.notes] == ["ann", "bob", "cid"]
    assert "no truth" in found.notes[0]
    assert "--align rigid" in found.notes[1]
    assert found.notes[2] == "cid: no output"
    assert found.people["cid"].availability == 0.0


def test_truth_of_another_time_is_said_and_not_scored():
    found = evaluate(
        {"ann": track(path_m(TIMES_S))}, {"ann": truth(offset_s=1e4)}, {}, {}, SPAN_NS, Comparing(True), ""
    )
    assert "less than half" in found.notes[0]
    assert found.people["ann"].scored == 0
