"""Where people can be: inside is its own nearest point, outside the nearest wall."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.site import Chamber, Gallery, Site
from mine_loc_core.walkable_area import WalkableArea

BEND = Gallery("bend", ((0, 0, 0), (20, 0, 0), (20, 30, 0)), width_m=4.0, height_m=3.0)
ROOM = Chamber("room", ((15, 30), (25, 30), (25, 40), (15, 40)), floor_m=0.0, height_m=3.0)
AREA = WalkableArea([BEND], [ROOM])


@pytest.mark.parametrize(
    ("point", "nearest"),
    [
        ((10, 1.9), (10, 1.9)),  # in the first leg
        ((21.9, -1.9), (21.9, -1.9)),  # in the outer corner of the bend
        ((24, 39), (24, 39)),  # in the chamber
        ((10, 5), (10, 2)),  # beside the first leg
        ((-3, 0), (0, 0)),  # before its flat end
        ((10, 35), (15, 35)),  # beside the chamber
        ((28, 44), (25, 40)),  # off the chamber's corner
        ((17.5, 3), (18, 3)),  # in the bend's inner corner, nearer to the second leg
    ],
)
def test_the_nearest_walkable_point(point, nearest):
    assert AREA.nearest(np.array([point], dtype=float))[0] == pytest.approx(nearest)
    assert AREA.outside_m(np.array([point], dtype=float))[0] == pytest.approx(np.hypot(*np.subtract(point, nearest)))


@given(st.tuples(st.floats(-50, 50), st.floats(-50, 50)))
def test_a_nearest_point_is_inside_and_nothing_on_the_centre_lines_is_nearer(point):
    at = np.array([point])
    nearest = AREA.nearest(at)
    assert AREA.outside_m(nearest)[0] < 1e-9
    line = np.array([[x, 0.0] for x in np.linspace(0, 20, 40)] + [[20.0, y] for y in np.linspace(0, 30, 40)])
    assert AREA.outside_m(at)[0] <= np.min(np.hypot(*(line - at).T)) + 1e-9


@given(st.tuples(st.floats(-50, 50), st.floats(-50, 50)))
def test_the_area_holds_a_point_that_is_not_outside(point):
    outside_m = AREA.outside_m(np.array([point]))[0]
    assert AREA.holds(np.array(point)) == (outside_m == 0.0) or outside_m < 1e-9


def test_legs_know_their_gallery_and_how_far_a_point_is_from_each():
    area = WalkableArea([BEND, Gallery("side", ((0, 10, 0), (10, 10, 0)), width_m=2.0, height_m=3.0)], [ROOM])
    assert area.gallery_of_leg.tolist() == [0, 0, 1]
    assert area.outside_legs_m(np.array([10.0, 5.0])) == pytest.approx([3.0, 8.0, 4.0])
    assert area.outside_chambers_m(np.array([10.0, 35.0])) == pytest.approx([5.0])
    assert area.outside_chambers_m(np.array([20.0, 35.0])) == pytest.approx([0.0])


def test_a_site_without_galleries_and_chambers_has_no_area():
    assert WalkableArea.of(Site("open", "map", 2, 1.0)) is None
