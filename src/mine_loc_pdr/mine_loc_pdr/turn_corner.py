"""Where on the ground a turn was made: the corner that a marker stands for.

The places of a turn in dead reckoning are poor, since steps in it are shorter than they seem. The ways before and after
it are good, and where they cross is where the marker is, whatever corner was cut.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.stamps import NS_PER_MS
from mine_loc_pdr.turns import Turn

Array = NDArray[np.float64]

LEAST_CROSSING_SINE = 0.5  # of the angle between two ways, for the crossing to be sharp
LONGEST_LEG_M = 3.0  # from the beginning or the end of a turn to the crossing
# So long before its first tenth and after its ninth, a turn has no part in the way yet, or no more.
CLEAR_NS = 250 * NS_PER_MS


@dataclass(frozen=True, slots=True)
class Corner:
    """A corner in a walked track; `since`, (2,) m, leads from it to the track's end, along the way after the turn.

    `loop`, (2,) m, is what the track puts between the way before and that after a turn that was made on the spot.
    """

    since: Array
    loop: Array


def corner_of(turn: Turn, track: Sequence[tuple[int, float, float]]) -> Corner | None:
    """The corner of a turn in a track of (stamp_ns, x, y), whose frame is that of the turn's headings.

    Ways that meet at a flat angle have no sharp crossing: there it is the middle of the turn. A reversal is taken for
    one on the spot, as far along the way as its middle. None if the track does not reach back to the turn.
    """
    if not track or turn.begin_ns < track[0][0]:
        return None
    stamps, x, y = np.array(track).T
    begin, middle, end = (
        np.array([np.interp(t, stamps, x), np.interp(t, stamps, y)])
        for t in (turn.begin_ns - CLEAR_NS, turn.middle_ns, turn.end_ns + CLEAR_NS)
    )
    here = np.array([x[-1], y[-1]])
    ahead, onward = _unit(turn.before_rad), _unit(turn.before_rad + turn.angle_rad)
    if abs(math.sin(turn.angle_rad)) >= LEAST_CROSSING_SINE:
        before_m, after_m = np.linalg.solve(np.column_stack([ahead, onward]), end - begin)
        if 0.0 <= before_m <= LONGEST_LEG_M and 0.0 <= after_m <= LONGEST_LEG_M:
            return Corner(here - (begin + before_m * ahead), np.zeros(2))
    elif math.cos(turn.angle_rad) < 0.0:
        loop = (end - begin) - ahead * (ahead @ (end - begin))
        return Corner(here - (end + ahead * (ahead @ (middle - end))), loop)
    return Corner(here - middle, np.zeros(2))


def _unit(angle_rad: float) -> Array:
    return np.array([math.cos(angle_rad), math.sin(angle_rad)])
