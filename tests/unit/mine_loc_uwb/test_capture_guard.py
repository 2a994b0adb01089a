"""Ranges that agree with one another and not with the track: when they are believed, and when they must not be."""

import numpy as np
import pytest
from uwb_scenes import PERIOD_S, ROOM, Track, sd_m, tracked

from mine_loc_core.verdicts import Reason
from mine_loc_uwb.tracker_settings import RobustTrackerSettings

HALL = ROOM * [3.0, 3.0, 1.0]
SOMEWHERE = (20.0, 20.0, 1.0)


def hall_after_a_blackout(seconds: float) -> Track:
    track = tracked(13, anchors=HALL, start_m=SOMEWHERE)
    track.silence(seconds)
    return track


def test_three_anchors_that_agree_on_a_place_nobody_can_have_walked_to_do_not_capture_it():
    track = hall_after_a_blackout(5.0)
    wrong, reopen_after_s = (40.0, 42.0, 1.0), RobustTrackerSettings().reopen_after_s
    guarded = 0
    for _ in range(round((reopen_after_s + 0.5) / PERIOD_S)):
        solution = track.round(only=[0, 1, 2], excess=track.pretending(wrong, [0, 1, 2]))
        assert track.error_m(solution) < 3.0 * sd_m(solution.fix)
        assert solution.reasons.count(Reason.ACCEPTED) == solution.fix.ranges_used <= 1
        guarded += Reason.CAPTURE_GUARD in solution.reasons
    assert guarded >= 3
    assert track.error_m(track.play(0.5)) < 0.2


def test_a_place_within_walking_reach_that_ranges_agree_on_is_taken_within_the_stated_time():
    track = hall_after_a_blackout(0.0)
    moved = (26.0, 22.0, 1.0)
    everyone, stated_s = range(len(HALL)), RobustTrackerSettings().reopen_after_s
    track.round(excess=track.pretending(moved, everyone))
    for _ in range(round(stated_s / PERIOD_S) + 2):
        solution = track.round(excess=track.pretending(moved, everyone))
    assert solution.reasons.count(Reason.ACCEPTED) >= len(HALL) - 1
    assert np.linalg.norm(solution.fix.position_m - moved) < 0.2


def test_a_place_out_of_reach_is_taken_when_all_ranges_have_agreed_on_it_for_long():
    """A person lifted by a vehicle, or a state that was wrong: unanimous for `guard_s` is believed in the end."""
    track = hall_after_a_blackout(0.0)
    far, everyone = (55.0, 43.0, 1.0), range(len(HALL))
    seen = [track.round(excess=track.pretending(far, everyone)) for _ in range(105)]
    assert Reason.CAPTURE_GUARD in seen[40].reasons
    assert np.linalg.norm(seen[40].fix.position_m - far) > 30.0
    assert np.linalg.norm(seen[-1].fix.position_m - far) < 0.2


@pytest.mark.parametrize("liars", [[0, 1, 2], [1, 3, 5], [0, 2, 4], [3, 4, 5]])
def test_half_of_the_anchors_agreeing_on_another_place_do_not_move_it(liars):
    track = tracked(14)
    wrong = (11.0, 8.0, 1.0)
    for _ in range(60):
        solution = track.round(excess=track.pretending(wrong, liars))
        assert track.error_m(solution) < 0.6
    assert set(solution.reasons) & {Reason.GATE, Reason.KINEMATIC, Reason.CAPTURE_GUARD}


@pytest.mark.parametrize(("space", "too_few"), [(False, 2), (True, 3)])
@pytest.mark.parametrize("seed", range(6))
def test_as_many_ranges_as_coordinates_agree_somewhere_whatever_they_say_and_are_not_believed(seed, space, too_few):
    track = tracked(seed, space=space, start_m=(8.0, 7.0, 1.2))
    lies = {liar: 7.0 + 5.0 * liar for liar in range(too_few, len(ROOM))}
    assert track.tracker._agreed_place(track.tag.round(track.at_s, excess=lies)) is None
    assert track.tracker._agreed_place(track.tag.round(track.at_s)) is not None


def test_a_minority_of_ranges_does_not_drag_a_track_that_coasted_wide():
    """One of three is believed by chance: it is AMBIGUOUS, nothing moves, and the spread goes on growing."""
    track = hall_after_a_blackout(5.0)
    spread_m = 0.0
    for _ in range(8):
        solution = track.round(only=[0, 1, 2], excess=track.pretending((47.0, 32.0, 1.0), [0, 1, 2]))
        assert Reason.ACCEPTED not in solution.reasons or solution.fix.ranges_used >= 2
        assert track.error_m(solution) < 3.0 * sd_m(solution.fix)
        assert sd_m(solution.fix) > spread_m or solution.fix.ranges_used >= 2
        spread_m = sd_m(solution.fix)
