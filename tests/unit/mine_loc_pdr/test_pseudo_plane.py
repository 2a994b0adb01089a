"""A turn is matched to a marker by place and angle, or refused with the reason."""

import math

import numpy as np
import pytest

from mine_loc_core.site import TurnMarker
from mine_loc_pdr.pseudo_plane import PseudoPlane, Verdict
from mine_loc_pdr.turns import Turn

QUARTERS = (math.pi / 2, -math.pi / 2)
CORNER = TurnMarker("corner", (10.0, 0.0, 0.0), QUARTERS, radius_m=4.0)
END = TurnMarker("end", (40.0, 0.0, 0.0), (math.pi,), radius_m=4.0)
PLANE = PseudoPlane([CORNER, END])


def turn(angle_deg, sd_deg=7.0):
    return Turn(1, 2, 3, 0.0, math.radians(angle_deg), math.radians(sd_deg) ** 2)


def verdict(plane, angle_deg, *position, covariance=None):
    fix = plane.match(turn(angle_deg), np.array(position, dtype=float), covariance)
    return None if fix is None else (fix.verdict, None if fix.marker is None else fix.marker.id)


@pytest.mark.parametrize("angle_deg", [90.0, -90.0, 75.0, -110.0])
def test_a_turn_near_a_marker_that_allows_it_is_matched(angle_deg):
    assert verdict(PLANE, angle_deg, 8.0, 1.0) == (Verdict.MATCHED, "corner")


def test_the_distance_is_told():
    fix = PLANE.match(turn(90.0), np.array([7.0, 4.0 / 3.0]))
    assert fix.distance_m == pytest.approx(math.hypot(3.0, 4.0 / 3.0))


@pytest.mark.parametrize("angle_deg", [180.0, -180.0, 170.0, -165.0])
def test_a_reversal_may_be_made_either_way_round(angle_deg):
    assert verdict(PLANE, angle_deg, 40.0, 0.0) == (Verdict.MATCHED, "end")


def test_a_turn_far_from_every_marker():
    assert verdict(PLANE, 90.0, 25.0, 0.0) == (Verdict.NO_MARKER_NEAR, None)


def test_a_turn_by_an_angle_that_the_marker_does_not_allow():
    assert verdict(PLANE, 180.0, 10.0, 0.0) == (Verdict.ANGLE_NOT_ALLOWED, None)
    left_only = PseudoPlane([TurnMarker("left", (0.0, 0.0, 0.0), (math.pi / 2,), 4.0)])
    assert verdict(left_only, -90.0, 0.0, 0.0) == (Verdict.ANGLE_NOT_ALLOWED, None)


def test_a_turn_below_the_least_angle_of_the_markers_is_none():
    assert verdict(PLANE, 30.0, 10.0, 0.0) is None
    assert verdict(PseudoPlane([END]), 90.0, 40.0, 0.0) is None


def test_a_site_without_markers_has_no_turns():
    assert verdict(PseudoPlane([]), 90.0, 0.0, 0.0) is None


def test_markers_on_top_of_each_other_are_refused_not_chosen_from():
    twin = TurnMarker("twin", CORNER.position_m, QUARTERS, 4.0)
    assert verdict(PseudoPlane([CORNER, twin]), 90.0, 10.0, 0.0) == (Verdict.AMBIGUOUS, None)


def test_the_angle_tells_two_near_markers_apart():
    beside = TurnMarker("beside", (11.0, 0.0, 0.0), (math.pi,), 4.0)
    plane = PseudoPlane([CORNER, beside])
    assert verdict(plane, 90.0, 10.5, 0.0) == (Verdict.MATCHED, "corner")
    assert verdict(plane, 180.0, 10.5, 0.0) == (Verdict.MATCHED, "beside")


def test_a_marker_beyond_what_the_walk_allows_is_not_near():
    sure = 0.2**2 * np.eye(2)
    assert verdict(PLANE, 90.0, 7.0, 0.0, covariance=sure) == (Verdict.NO_MARKER_NEAR, None)
    assert verdict(PLANE, 90.0, 9.5, 0.0, covariance=sure) == (Verdict.MATCHED, "corner")


@pytest.mark.parametrize("position", [(math.nan, 0.0), (0.0, math.inf)])
def test_a_position_that_is_none_matches_nothing(position):
    assert verdict(PLANE, 90.0, *position) == (Verdict.NO_MARKER_NEAR, None)
