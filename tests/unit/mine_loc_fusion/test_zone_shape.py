"""Distances from zones, checked against shapely-free geometry: known values, rotation, and sampling of the border."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_fusion.zone_shape import ZoneShape, outline

SQUARE = outline(2.0, 2.0)
ELL = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 1.0], [1.0, 1.0], [1.0, 4.0], [0.0, 4.0]])
coordinates = st.floats(-10.0, 10.0)


@pytest.mark.parametrize(
    ("polygon", "point", "distance_m"),
    [
        (SQUARE, (0.0, 0.0), -1.0),
        (SQUARE, (3.0, 0.0), 2.0),
        (SQUARE, (4.0, 5.0), 5.0),  # from a corner
        (SQUARE, (0.0, 0.75), -0.25),
        (ELL, (2.0, 2.0), 1.0),  # in the notch: outside
        (ELL, (0.5, 3.0), -0.5),
        (ELL[::-1], (0.5, 3.0), -0.5),  # whichever way round the corners are given
    ],
)
def test_distances_that_can_be_told_by_eye(polygon, point, distance_m):
    assert ZoneShape(polygon).signed_distance_m(np.array([point]))[0] == pytest.approx(distance_m)
    assert ZoneShape(polygon, 0.5).signed_distance_m(np.array([point]))[0] == pytest.approx(distance_m - 0.5)


@given(coordinates, coordinates)
def test_the_size_is_the_distance_to_the_nearest_point_of_the_border(x, y):
    along = np.linspace(0.0, 1.0, 401)[:, None]
    border = np.vstack([a + along * (b - a) for a, b in zip(ELL, np.roll(ELL, -1, axis=0), strict=True)])
    nearest = np.min(np.linalg.norm(border - (x, y), axis=1))
    assert abs(ZoneShape(ELL).signed_distance_m(np.array([[x, y]]))[0]) == pytest.approx(nearest, abs=0.01)


@given(coordinates, coordinates, coordinates, coordinates, st.floats(-math.pi, math.pi))
def test_a_point_that_moves_with_the_body_keeps_its_distance(x, y, to_x, to_y, yaw):
    cos, sin = math.cos(yaw), math.sin(yaw)
    moved = np.array([[to_x + cos * x - sin * y, to_y + sin * x + cos * y]])
    shape = ZoneShape(ELL, 0.3)
    expected = shape.signed_distance_m(np.array([[x, y]]))[0]
    assert shape.placed(to_x, to_y, yaw).signed_distance_m(moved)[0] == pytest.approx(expected, abs=1e-9)
