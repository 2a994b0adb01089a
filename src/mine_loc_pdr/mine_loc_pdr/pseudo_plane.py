"""Paper B's pseudo-plane (its sections 3.1 and 3.3): turns matched to the marked turning points of a site.

A turn counts when its angle reaches the least turn angle among the markers. It is matched by position, which is the
paper's equation 14, and by angle. Where more than one marker fits, none is taken: the nearest would often be the wrong
one, and a wrong reset is worse than none. All positions are in the map.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.site import TurnMarker
from mine_loc_pdr.turns import Turn

Array = NDArray[np.float64]

# Assumed: how far from a marker, in each coordinate, people turn who follow a gallery; a corner is cut.
MARKER_SD_M = 0.3
# Assumed: how much people turn more or less than the angle of the marker before they walk straight on.
CORNERING_SD_RAD = math.radians(8.0)
ANGLE_GATE_SD = 3.0
POSITION_GATE = 13.8  # squared Mahalanobis distance that 999 of 1000 true matches stay below, two dimensions


class Verdict(IntEnum):
    """The same numbers as in mine_loc_interfaces/LandmarkFix."""

    MATCHED = 1
    AMBIGUOUS = 2
    NO_MARKER_NEAR = 3
    ANGLE_NOT_ALLOWED = 4


@dataclass(frozen=True, slots=True)
class LandmarkFix:
    """What became of a turn. `marker` is set when it is MATCHED; `distance_m` is that to the nearest marker."""

    turn: Turn
    verdict: Verdict
    marker: TurnMarker | None
    distance_m: float


class PseudoPlane:
    """The markers of a site."""

    def __init__(self, markers: Sequence[TurnMarker]) -> None:
        self._markers = tuple(markers)
        self._least_angle_rad = min((abs(a) for m in markers for a in m.angles_rad), default=math.inf)

    def match(self, turn: Turn, position_m: Array, covariance_m2: Array | None = None) -> LandmarkFix | None:
        """Judge a turn whose middle was at `position_m` (2,); None if it is too small for any marker.

        `covariance_m2` (2, 2) of the position, where it is known, keeps away markers that the walk cannot have reached.
        """
        tolerance_rad = ANGLE_GATE_SD * math.sqrt(turn.angle_variance_rad2 + CORNERING_SD_RAD**2)
        if not abs(turn.angle_rad) >= self._least_angle_rad - tolerance_rad:
            return None
        distances_m = [math.dist(m.position_m[:2], position_m) for m in self._markers]
        nearest_m = min(distances_m)
        near = [
            marker
            for marker, distance_m in zip(self._markers, distances_m, strict=True)
            if distance_m <= marker.radius_m and _within_reach(marker, position_m, covariance_m2)
        ]
        fitting = [m for m in near if any(_off_rad(turn, a) <= tolerance_rad for a in m.angles_rad)]
        if len(fitting) == 1:
            return LandmarkFix(turn, Verdict.MATCHED, fitting[0], math.dist(fitting[0].position_m[:2], position_m))
        if fitting:
            return LandmarkFix(turn, Verdict.AMBIGUOUS, None, nearest_m)
        return LandmarkFix(turn, Verdict.ANGLE_NOT_ALLOWED if near else Verdict.NO_MARKER_NEAR, None, nearest_m)


def _off_rad(turn: Turn, angle_rad: float) -> float:
    """Between the angles, either of which may be a reversal: that ends the same whichever way round it is made."""
    return abs(math.remainder(turn.angle_rad - angle_rad, math.tau))


def _within_reach(marker: TurnMarker, position_m: Array, covariance_m2: Array | None) -> bool:
    if covariance_m2 is None:
        return True
    off_m = np.array(marker.position_m[:2]) - position_m
    spread_m2 = covariance_m2 + MARKER_SD_M**2 * np.eye(2)
    return bool(off_m @ np.linalg.solve(spread_m2, off_m) <= POSITION_GATE)
