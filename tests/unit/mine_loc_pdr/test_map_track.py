"""The track in the map: steps carry it, markers and galleries correct it, and nothing lets it jump."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.site import Gallery, TurnMarker
from mine_loc_core.stamps import NS_PER_S, to_ns
from mine_loc_core.walkable_area import WalkableArea
from mine_loc_pdr.dead_reckoning import StepEvent
from mine_loc_pdr.gallery_constraint import GalleryConstraint
from mine_loc_pdr.map_track import SCALE, YAW, MapPose, MapTrack
from mine_loc_pdr.pseudo_plane import PseudoPlane, Verdict
from mine_loc_pdr.turns import Turn

CORNER = TurnMarker("corner", (20.0, 0.0, 0.0), (math.pi / 2, -math.pi / 2), 4.0)
MAIN = Gallery("main", ((0, 0, 0), (200, 0, 0)), width_m=4.0, height_m=3.0)
STEP_S = 0.55


def track(galleries=None, yaw_sd_deg=3.0, markers=(CORNER,)):
    start = MapPose(NS_PER_S, 0.0, 0.0, 0.0, np.diag([0.1**2, 0.1**2, math.radians(yaw_sd_deg) ** 2]))
    return MapTrack(start, 0.0, 0.06**2, 0.001, PseudoPlane(markers), galleries)


def step(number, heading_rad=0.0, length_m=0.7):
    stamp_ns = NS_PER_S + to_ns(number * STEP_S)
    return StepEvent(stamp_ns, number, STEP_S, length_m, 0.01, heading_rad, 0.01, 0.0, 0.0, 1.0)


def walk(followed, headings, length_m=0.7):
    for number, heading in enumerate(headings, 1):
        followed.step(step(number, heading, length_m))
    return followed


def place(followed):
    pose = followed.pose()
    return np.array([pose.x_m, pose.y_m])


def turn_at(number, angle_rad=math.pi / 2, before_rad=0.0):
    """A turn in the step after the given one."""
    begin_ns = step(number).stamp_ns
    return Turn(begin_ns, begin_ns + to_ns(STEP_S / 2), begin_ns + to_ns(STEP_S), before_rad, angle_rad, 0.01)


def test_steps_go_where_the_heading_points_in_the_map():
    start = MapPose(NS_PER_S, 5.0, 6.0, math.radians(90.0), np.zeros((3, 3)))
    followed = MapTrack(start, math.radians(30.0), 0.06**2, 0.001, PseudoPlane([]))
    walk(followed, [math.radians(30.0)] * 10)
    assert place(followed) == pytest.approx([5.0, 13.0])
    assert math.degrees(followed.pose().yaw_rad) == pytest.approx(90.0)


def test_a_marker_puts_the_track_right_and_tells_the_steps_too_long():
    """The person walked 20 m, dead reckoning 21 m: the rest of the way is shorter, too."""
    followed = walk(track(), [0.0] * 30 + [math.pi / 2] * 2)
    before = place(followed)
    fix = followed.turn(turn_at(30))
    assert fix.verdict is Verdict.MATCHED
    assert abs(place(followed)[0] - 20.0) < 0.25
    assert abs(before[0] - 20.0) > 0.9
    assert 0.94 < followed._state[SCALE] < 0.99


def test_a_marker_tells_the_heading_that_led_astray():
    followed = walk(track(yaw_sd_deg=5.0), [math.radians(4.0)] * 29 + [math.radians(94.0)] * 2)
    followed.turn(turn_at(29, before_rad=math.radians(4.0)))
    assert math.degrees(followed._state[YAW]) == pytest.approx(-4.0, abs=1.5)


def test_uncertainty_grows_with_the_way_and_shrinks_at_a_marker():
    followed = track()
    areas = []
    for number in range(1, 30):
        followed.step(step(number, 0.0))
        areas.append(np.linalg.det(followed.pose().covariance[:2, :2]))
    assert np.all(np.diff(areas) > 0.0)
    followed.step(step(30, math.pi / 2))
    followed.turn(turn_at(29))
    assert np.linalg.det(followed.pose().covariance[:2, :2]) < 0.2 * areas[-1]


@pytest.mark.parametrize(
    ("markers", "verdict"),
    [
        ((CORNER, replace(CORNER, id="twin")), Verdict.AMBIGUOUS),
        ((replace(CORNER, position_m=(90.0, 0.0, 0.0)),), Verdict.NO_MARKER_NEAR),
    ],
)
def test_a_turn_that_is_refused_changes_nothing(markers, verdict):
    followed = walk(track(markers=markers), [0.0] * 29 + [math.pi / 2] * 2)
    before = followed.pose()
    assert followed.turn(turn_at(29)).verdict is verdict
    assert place(followed) == pytest.approx([before.x_m, before.y_m])
    assert followed.pose().covariance == pytest.approx(before.covariance)


def test_who_looks_about_standing_is_at_no_marker():
    followed = walk(track(), [0.0] * 29)
    assert followed.turn(turn_at(40)) is None
    assert followed.faults["standing"] == 1
    just_told = track()
    assert just_told.turn(turn_at(1)) is None
    assert just_told.faults["standing"] == 1


def test_a_turn_too_old_to_place_is_counted_and_dropped():
    followed = walk(track(), [0.0] * 60)
    assert followed.turn(turn_at(2)) is None
    assert followed.faults["forgotten"] == 1


def test_a_gallery_takes_out_a_drift_of_the_heading():
    """0.2 °/s over 130 s: alone the track leaves a gallery 4 m wide, and its covariance knows it."""
    drifting = [math.radians(0.2) * STEP_S * number for number in range(240)]
    alone, guided = (walk(track(galleries), drifting) for galleries in (None, GalleryConstraint(WalkableArea([MAIN]))))
    assert abs(place(alone)[1]) > 20.0
    assert abs(place(guided)[1]) < 2.0
    assert guided.pose().covariance[1, 1] < 0.05 * alone.pose().covariance[1, 1]


def test_a_gallery_does_not_hold_who_leaves_it():
    guided = walk(track(GalleryConstraint(WalkableArea([MAIN]))), [0.0] * 30 + [math.radians(60.0)] * 30)
    assert place(guided)[1] > 15.0


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"heading_rad": math.nan}, "not_finite"),
        ({"length_m": math.inf}, "not_finite"),
        ({"length_m": 50.0}, "too_long"),
        ({"stamp_ns": step(10).stamp_ns}, "duplicate"),
        ({"stamp_ns": step(3).stamp_ns}, "backward"),
    ],
)
def test_bad_steps_are_counted_and_move_nobody(change, fault):
    followed = walk(track(), [0.0] * 10)
    before = place(followed)
    followed.step(replace(step(11), **change))
    assert place(followed) == pytest.approx(before)
    assert followed.faults[fault] == 1


angles = st.floats(-10.0, 10.0, allow_nan=False) | st.just(math.nan)
events = st.one_of(
    st.tuples(st.just("step"), st.integers(-2, 8), angles, st.floats(-1.0, 3.0)),
    st.tuples(st.just("turn"), st.integers(-10, 2), angles, st.floats(-4.0, 4.0)),
    st.tuples(st.just("gap"), st.floats(0.0, 3.0)),
)


@given(st.lists(events, max_size=60), st.booleans())
def test_whatever_comes_the_track_stays_sound_and_jumps_no_further_than_a_marker(history, in_gallery):
    twin = replace(CORNER, id="near", position_m=(2.0, 0.0, 0.0))
    followed = track(GalleryConstraint(WalkableArea([MAIN])) if in_gallery else None, markers=(CORNER, twin))
    number = 0
    for kind, *values in history:
        before = place(followed)
        if kind == "step":
            number += values[0]
            followed.step(step(number, values[1], values[2]))
            guided_m = 3.0 if in_gallery else 0.0
            assert np.linalg.norm(place(followed) - before) <= 3.0 + guided_m
        elif kind == "turn":
            fix = followed.turn(turn_at(number + values[0], values[2], values[1]))
            moved_m = np.linalg.norm(place(followed) - before)
            matched = fix is not None and fix.verdict is Verdict.MATCHED
            assert moved_m <= (2.0 * CORNER.radius_m if matched else 0.0)
        else:
            followed.gap(values[0])
        pose = followed.pose()
        assert np.isfinite([pose.x_m, pose.y_m, pose.yaw_rad]).all()
        assert np.linalg.eigvalsh(followed._covariance).min() > -1e-9 * max(1.0, np.trace(followed._covariance))
