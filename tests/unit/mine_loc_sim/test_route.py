import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import to_ns
from mine_loc_sim.route import WayPoint, plan_route

START, END = WayPoint((0.0, 0.0, 0.0), pause_s=3.0), WayPoint((30.0, 0.0, 0.0), pause_s=3.0)


def grid(route, step_s=0.01):
    return np.arange(-1.0, route.duration_s + 2.0, step_s)


def test_a_route_starts_and_ends_at_rest_at_its_ends():
    route = plan_route([START, END])
    pose = route.at(np.array([-5.0, 0.0, route.duration_s, route.duration_s + 60.0]))
    np.testing.assert_allclose(pose.position_m, [[0, 0, 0], [0, 0, 0], [30, 0, 0], [30, 0, 0]], atol=1e-9)
    np.testing.assert_allclose(pose.velocity_m_s, 0.0, atol=1e-9)


def test_the_walker_goes_on_at_the_speed_a_way_point_says_and_else_at_the_preferred_one():
    route = plan_route([START, WayPoint((30.0, 0.0, 0.0), speed_m_s=0.8), WayPoint((60.0, 0.0, 0.0), pause_s=3.0)], 1.4)
    pose = route.at(grid(route))
    at = {x: pose.velocity_m_s[np.argmin(np.abs(pose.position_m[:, 0] - x)), 0] for x in (15.0, 45.0)}
    assert at == pytest.approx({15.0: 1.4, 45.0: 0.8}, rel=1e-6)


def test_velocity_and_turn_rate_are_the_derivatives_of_position_and_heading_and_the_jerk_is_finite():
    route = plan_route(
        [START, WayPoint((10.0, 0.0, 0.0)), WayPoint((10.0, 8.0, 1.0)), WayPoint((0.0, 8.0, 1.0), pause_s=2.0)]
    )
    step = 1e-3
    pose = route.at(grid(route, step))
    for values, rates in (
        (pose.position_m, pose.velocity_m_s),
        (pose.velocity_m_s, pose.acceleration_m_s2),
        (pose.heading_rad, pose.turn_rate_rad_s),
        (pose.turn_rate_rad_s, pose.turn_acceleration_rad_s2),
    ):
        np.testing.assert_allclose(np.diff(values, axis=0) / step, (rates[1:] + rates[:-1]) / 2, atol=1e-4)
    assert np.abs(np.diff(pose.acceleration_m_s2, axis=0)).max() / step < 20.0


def test_a_corner_is_rounded_inside_and_slowed_down_for():
    route = plan_route([START, WayPoint((20.0, 0.0, 0.0)), WayPoint((20.0, 20.0, 0.0))], 1.3)
    pose = route.at(grid(route))
    x, y = pose.position_m[:, 0], pose.position_m[:, 1]
    assert np.all((x < 20.0 + 1e-9) & (y > -1e-9))
    cut = np.hypot(x - 20.0, y).min()
    assert 0.05 < cut < 0.5
    near = np.hypot(x - 20.0, y) < 1.0
    assert np.linalg.norm(pose.velocity_m_s[near], axis=1).min() < 1.3 * 0.8
    assert pose.heading_rad[-1] == pytest.approx(math.pi / 2)


def test_a_reversal_is_turned_on_the_spot_to_the_left_and_does_not_pass_the_way_point():
    route = plan_route([START, WayPoint((10.0, 0.0, 0.0)), WayPoint((0.0, 0.0, 0.0), pause_s=2.0)])
    pose = route.at(grid(route))
    assert pose.position_m[:, 0].max() <= 10.0
    assert pose.heading_rad[-1] == pytest.approx(math.pi)
    assert [turn.angle_rad for turn in route.turns] == [pytest.approx(math.pi)]


def test_a_walker_faces_where_told_while_pausing_and_then_goes_on():
    look = WayPoint((10.0, 0.0, 0.0), pause_s=8.0, face_rad=-math.pi / 2)
    route = plan_route([START, look, END])
    pose = route.at(grid(route))
    standing = np.abs(pose.position_m[:, 0] - 10.0) < 1e-6
    assert pose.heading_rad[standing].min() == pytest.approx(-math.pi / 2)
    assert pose.heading_rad[-1] == pytest.approx(0.0, abs=1e-9)


def test_slower_people_turn_more_slowly():
    points = [START, WayPoint((10.0, 0.0, 0.0)), WayPoint((0.0, 0.0, 0.0))]
    slow, fast = (plan_route(points, v) for v in (0.8, 1.6))
    peaks = [np.abs(r.at(grid(r)).turn_rate_rad_s).max() for r in (slow, fast)]
    assert peaks[0] < 0.8 * peaks[1]


def test_stamps_are_instants_of_the_route_shifted_by_its_start():
    route = plan_route([START, END])
    start_ns = 1_700_000_000_123_456_789
    stamps = start_ns + np.array([0, to_ns(7.5), to_ns(9.25)])
    np.testing.assert_array_equal(
        route.at_stamps(stamps, start_ns).position_m, route.at(np.array([0.0, 7.5, 9.25])).position_m
    )


@pytest.mark.parametrize(
    ("points", "says"),
    [
        ([START], "1 way-points, at least 2"),
        ([START, WayPoint((0.0, 0.01, 0.0))], "way-points 0 and 1"),
        ([START, WayPoint((5.0, 0.0, 0.0), speed_m_s=9.0), END], "way-point 1: speed 9.0"),
        ([START, WayPoint((5.0, 0.0, 0.0), speed_m_s=0.0), END], "way-point 1: speed 0.0"),
        ([START, WayPoint((5.0, 0.0, 0.0), pause_s=math.nan), END], "way-point 1: pause nan"),
        ([START, WayPoint((5.0, 0.0, 0.0), face_rad=1.0), END], "way-point 1: face_rad"),
        ([START, WayPoint((math.nan, 0.0, 0.0)), END], "way-points 0 and 1"),
    ],
)
def test_an_impossible_route_is_refused_with_its_reason(points, says):
    with pytest.raises(ConfigurationError, match=says):
        plan_route(points)


coordinate = st.floats(-100.0, 100.0)


@settings(max_examples=40)
@given(st.lists(st.tuples(coordinate, coordinate), min_size=2, max_size=7), st.floats(0.4, 2.0))
def test_any_route_passes_its_ends_within_its_speed_and_its_corridor(corners, speed):
    points = [WayPoint((x, y, 0.0)) for x, y in corners]
    if min(math.dist(a.position_m, b.position_m) for a, b in itertools.pairwise(points)) < 0.06:
        return
    route = plan_route(points, speed)
    pose = route.at(np.linspace(-2.0, route.duration_s + 3.0, 2000))
    np.testing.assert_allclose(pose.position_m[[0, -1], :2], [corners[0], corners[-1]], atol=1e-6)
    assert np.linalg.norm(pose.velocity_m_s, axis=1).max() <= speed * 1.001
    ends = np.array(corners)
    legs, to = np.diff(ends, axis=0), pose.position_m[:, None, :2] - ends[None, :-1]
    along = np.clip((to * legs).sum(-1) / (legs**2).sum(-1), 0.0, 1.0)
    off = np.linalg.norm(to - along[..., None] * legs, axis=-1).min(axis=1)
    assert off.max() < 0.6 * speed + 1e-6
