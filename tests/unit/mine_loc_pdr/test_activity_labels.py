"""What counts as a turn, and which windows nobody can tell."""

import math

import pytest

from mine_loc_core.stamps import to_ns
from mine_loc_pdr.activity import ActivityKind
from mine_loc_pdr.activity_labels import LEAST_TURN_RAD, MarkedWalk, decidable, label, label_marked

STANDING, STRAIGHT, TURNING, UNKNOWN = (
    ActivityKind.STANDING, ActivityKind.STRAIGHT, ActivityKind.TURNING, ActivityKind.UNKNOWN
)  # fmt: skip


@pytest.mark.parametrize(
    ("turn_deg", "steps", "expected"),
    [(0.0, 7, STRAIGHT), (22.0, 7, STRAIGHT), (23.0, 7, TURNING), (90.0, 7, TURNING), (0.0, 0, STANDING),
     (90.0, 2, UNKNOWN), (0.0, 3, UNKNOWN)],
)  # fmt: skip
def test_half_the_least_turn_of_the_markers_is_a_turn_and_few_steps_are_a_start_or_a_halt(turn_deg, steps, expected):
    assert label(math.radians(turn_deg), steps) == expected


@pytest.mark.parametrize("cut", [0.0, 0.3, 0.5, 0.8])
def test_the_least_turn_cut_in_two_by_the_edge_of_a_window_is_a_turn_in_one_of_the_two(cut):
    parts = (cut * LEAST_TURN_RAD, (1.0 - cut) * LEAST_TURN_RAD)
    assert TURNING in {label(part, 7) for part in parts}


@pytest.mark.parametrize(("turn_deg", "sure"), [(0.0, True), (14.9, True), (15.1, False), (29.9, False), (30.1, True)])
def test_close_to_the_border_the_swing_of_the_waist_would_decide(turn_deg, sure):
    assert decidable(math.radians(turn_deg)) == sure


def marked(begin_s):
    """A window from there in a walk: out from 5 s, U-turn from 14 to 16 s, back until 25 s and a marked end at 28 s."""
    walk = MarkedWalk(*(to_ns(t) for t in (5.0, 14.0, 16.0, 28.0)))
    return label_marked(to_ns(begin_s), to_ns(begin_s + 4.0), walk)


@pytest.mark.parametrize(
    ("begin_s", "expected"),
    [
        (0.7, STANDING),  # ends half a step before the walk
        (0.8, UNKNOWN),
        (4.9, UNKNOWN),  # begins before the walk
        (5.0, STRAIGHT),
        (9.7, STRAIGHT),  # ends half a step before the U-turn
        (9.8, UNKNOWN),
        (10.9, UNKNOWN),  # holds less than half of it
        (11.0, TURNING),
        (13.0, TURNING),  # holds it
        (15.0, TURNING),
        (15.1, UNKNOWN),
        (16.2, UNKNOWN),
        (16.3, STRAIGHT),
        (21.0, STRAIGHT),  # ends when the way back has taken as long as the way out
        (21.1, UNKNOWN),  # some turn round once more before the marked end
        (26.0, UNKNOWN),
    ],
)
def test_marks_tell_what_lies_clear_of_their_borders(begin_s, expected):
    assert marked(begin_s) == expected


def test_a_way_back_faster_than_the_way_out_ends_at_the_marked_end():
    walk = MarkedWalk(*(to_ns(t) for t in (5.0, 14.0, 16.0, 22.0)))
    assert label_marked(to_ns(18.0), to_ns(22.0), walk) == STRAIGHT
    assert label_marked(to_ns(18.1), to_ns(22.1), walk) == UNKNOWN
