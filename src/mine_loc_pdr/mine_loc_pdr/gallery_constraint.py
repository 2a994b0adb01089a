"""What the galleries of a site say about a walking person (paper B names it as future work, its section 4.4).

People in a gallery walk along it: near its centre line by what its width leaves, and in its direction, either way.
Borenstein and Ojeda use the second for corridors ("Heuristic drift elimination for personnel tracking systems",
Journal of Navigation 63, 2010). Both hold for a stretch of walking as a whole, not for each step anew, so a step is
given its share of what a stretch tells.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.walkable_area import WalkableArea

Array = NDArray[np.float64]

# Assumed. A quarter of the width keeps 95 of 100 people off the walls; a person changes sides in some metres.
ACROSS_SD_SHARE = 0.25
COURSE_SD_RAD = math.radians(5.0)
STRETCH_M = 5.0
LARGEST_COURSE_OFF_RAD = math.radians(25.0)  # beyond it a person crosses the gallery or turns
REACH_SD = 3.0


@dataclass(frozen=True, slots=True)
class Guidance:
    """What a gallery says of a step in it.

    across_m: how far left of the centre line the person is believed; left: unit vector (2,) that way, in the map;
    course_off_rad: by how much the course is left of the gallery's. Variances hold for the one step.
    """

    across_m: float
    across_variance_m2: float
    left: Array
    course_off_rad: float
    course_variance_rad2: float


class GalleryConstraint:
    """Finds the gallery that a person walks along, and says where in it people walk."""

    def __init__(self, area: WalkableArea) -> None:
        self._area = area

    def guide(self, position_m: Array, sd_m: float, course_rad: float, length_m: float) -> Guidance | None:
        """Guidance of a step of `length_m` that ends at `position_m` (2,), known with `sd_m` in any direction.

        None where no gallery leads that way, more than one may, or a chamber is in reach: there people walk as they
        like.
        """
        leg = self._leg(position_m, sd_m, course_rad)
        if leg is None or length_m <= 0.0:
            return None
        start, along, half_width_m = leg[0:2], leg[2:4], float(leg[6])
        left = np.array([-along[1], along[0]])
        steps = STRETCH_M / length_m
        return Guidance(
            float(left @ (position_m - start)),
            (2.0 * half_width_m * ACROSS_SD_SHARE) ** 2 * steps,
            left,
            _course_off_rad(course_rad, along),
            COURSE_SD_RAD**2 * steps,
        )

    def _leg(self, position_m: Array, sd_m: float, course_rad: float) -> Array | None:
        area = self._area
        if not len(area.legs) or np.any(area.outside_chambers_m(position_m) <= REACH_SD * sd_m):
            return None
        outside_m = area.outside_legs_m(position_m)
        off_rad = np.array([abs(_course_off_rad(course_rad, leg[2:4])) for leg in area.legs])
        possible = np.flatnonzero((outside_m <= REACH_SD * sd_m) & (off_rad <= LARGEST_COURSE_OFF_RAD))
        if len(set(area.gallery_of_leg[possible].tolist())) != 1:
            return None
        best: Array = area.legs[min(possible, key=lambda leg: (outside_m[leg], off_rad[leg]))]
        return best


def _course_off_rad(course_rad: float, along: Array) -> float:
    """Course against a line that may be walked either way, -π/2..π/2."""
    return math.remainder(course_rad - math.atan2(along[1], along[0]), math.pi)
