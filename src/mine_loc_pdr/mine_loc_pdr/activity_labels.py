"""What a window truly was, and which windows are undecidable: never by what a classifier says of them.

Paper B takes a turn for one whose angle exceeds the least turn angle of the markers; its windows hold one or none.
Windows of a walk also cut turns in two. A window in which the heading changed by half the least turn angle counts as a
turn, so that a turn cut in two is one in at least one of the windows. Close to that border, where the waist's own swing
against the path decides, a window is taught but not scored.
"""

import math
from dataclasses import dataclass

from mine_loc_core.stamps import NS_PER_MS
from mine_loc_pdr.activity import ActivityKind
from mine_loc_pdr.activity_window import ActivityWindow

LEAST_TURN_RAD = math.radians(45.0)  # of the markers of a site
BORDER_RAD = 0.5 * LEAST_TURN_RAD
UNDECIDED_RAD = math.radians(7.5)  # on either side: the waist swings by some 6° against the way walked
FEWEST_STEPS = 4  # in a window of walking; none is standing, between lies a start or a halt


@dataclass(frozen=True, slots=True)
class LabelledWindow:
    """A window, who walked it, and how many bins after the beginning of walk `walk` it begins; UNKNOWN has no label."""

    person: str
    walk: str
    place: int
    window: ActivityWindow
    label: ActivityKind
    decidable: bool = True


def label(true_turn_rad: float, steps: int) -> ActivityKind:
    """From the greatest true change of heading between any two instants of the window and the true steps in it."""
    if steps == 0:
        return ActivityKind.STANDING
    if steps < FEWEST_STEPS:
        return ActivityKind.UNKNOWN
    return ActivityKind.TURNING if true_turn_rad >= BORDER_RAD else ActivityKind.STRAIGHT


def decidable(true_turn_rad: float) -> bool:
    """Whether the turn is far enough from the border to be scored."""
    return abs(true_turn_rad - BORDER_RAD) >= UNDECIDED_RAD


@dataclass(frozen=True, slots=True)
class MarkedWalk:
    """A walk to a place and back of which begin, U-turn and end are marked by hand."""

    begin_ns: int
    turn_begin_ns: int
    turn_end_ns: int
    end_ns: int


HALF_STEP_NS = 300 * NS_PER_MS  # marks are those of steps
# Of a U-turn of 180°: with marks off by half a step still a third of it, or 30° whatever its profile.
MARKED_TURN_SHARE = 0.5


def label_marked(begin_ns: int, end_ns: int, walk: MarkedWalk) -> ActivityKind:
    """From marks, which tell no angle. Before the walk the person stands, and in it but for the U-turn goes straight.

    Undecidable are windows with a smaller part of the U-turn, and those that reach beyond the time after which the way
    back is done, taken to be that of the way out: some people turn round once more before the marked end.
    """
    if end_ns <= walk.begin_ns - HALF_STEP_NS:
        return ActivityKind.STANDING
    back_ns = min(walk.turn_end_ns + (walk.turn_begin_ns - walk.begin_ns), walk.end_ns)
    if begin_ns < walk.begin_ns or end_ns > back_ns:
        return ActivityKind.UNKNOWN
    inside_ns = min(end_ns, walk.turn_end_ns) - max(begin_ns, walk.turn_begin_ns)
    if inside_ns >= MARKED_TURN_SHARE * (walk.turn_end_ns - walk.turn_begin_ns):
        return ActivityKind.TURNING
    return ActivityKind.STRAIGHT if inside_ns <= -HALF_STEP_NS else ActivityKind.UNKNOWN
