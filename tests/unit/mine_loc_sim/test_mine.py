"""What a straight link meets: free space, rock, obstacles, people, and the way round."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_sim.mine import Mine, gallery_prisms
from mine_loc_sim.prism import ConvexPrisms, Prism, contains
from mine_loc_sim.radio_constants import MATTER

L_SHAPE = gallery_prisms([(0, 0, 0), (20, 0, 0), (20, 20, 0)], width_m=4.0, height_m=3.0)
L_MINE = Mine.build(L_SHAPE, (), np.array([[0.0, 0, 1.5], [20.0, 0, 1.5], [20.0, 20, 1.5]]))


def look(mine, start, end, people=None):
    return mine.look(np.array([start], float), np.array([end], float), people)


def box(x0, y0, x1, y1, top=3.0, material="steel"):
    return Prism(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], float), 0.0, top, material)


def test_a_link_along_the_gallery_is_clear():
    link = look(L_MINE, (1, 0, 1), (18, 1, 2))
    assert link.clear[0]
    assert link.rock_m[0] == 0.0
    assert link.detour_m[0] == 0.0


def test_a_link_through_the_bend_stays_in_the_joint():
    assert look(L_MINE, (19, 0, 1), (20, 2.5, 1)).rock_m[0] == 0.0


def test_a_link_across_the_corner_runs_through_rock_and_has_a_way_round():
    link = look(L_MINE, (4, 0, 1.5), (20, 16, 1.5))
    straight = np.hypot(16, 16)
    leaves_at, enters_at = 2.0 * np.sqrt(2.0), straight - 2.0 * np.sqrt(2.0)
    assert link.rock_m[0] == pytest.approx(enters_at - leaves_at, abs=1e-6)
    assert link.detour_m[0] == pytest.approx(32.0 - straight, abs=1e-6)
    assert link.corners[0] == 1
    assert link.loss_db[0] > 80.0


def test_a_place_without_galleries_is_open():
    assert look(Mine.build(), (0, 0, 0), (100, 100, 5)).clear[0]


def test_separate_galleries_have_no_way_round():
    free = gallery_prisms([(0, 0, 0), (10, 0, 0)], 4.0, 3.0) + gallery_prisms([(0, 50, 0), (10, 50, 0)], 4.0, 3.0)
    mine = Mine.build(free, (), np.array([[5.0, 0, 1.5], [5.0, 50, 1.5]]))
    assert np.isinf(look(mine, (1, 0, 1), (1, 50, 1)).detour_m[0])


def test_the_roof_is_rock():
    assert look(L_MINE, (5, 0, 1), (6, 0, 6)).rock_m[0] == pytest.approx(np.hypot(1, 5) * 3.0 / 5.0)


def test_an_obstacle_weakens_by_its_thickness_and_material():
    wall = Mine.build(obstacles=(box(2, -5, 2.2, 5, material="concrete"),))
    link = look(wall, (0, 0, 1), (4, 0, 1))
    concrete = MATTER["concrete"]
    assert link.loss_db[0] == pytest.approx(0.2 * concrete.loss_db_per_m + concrete.surface_loss_db)
    assert link.delay_m[0] == pytest.approx(0.2 * concrete.delay_index)


def test_the_way_over_a_low_obstacle_is_shorter_than_the_way_round():
    low, high = Mine.build(obstacles=(box(2, -5, 3, 5, top=2.0),)), Mine.build(obstacles=(box(2, -5, 3, 5, top=20.0),))
    over = look(low, (0, 0, 1.5), (5, 0, 1.5)).detour_m[0]
    assert over == pytest.approx(2 * np.hypot(2.5, 0.5) - 5.0, abs=1e-6)
    assert look(high, (0, 0, 1.5), (5, 0, 1.5)).detour_m[0] > 5.0


def test_a_link_above_an_obstacle_is_clear():
    assert look(Mine.build(obstacles=(box(2, -5, 3, 5, top=1.0),)), (0, 0, 1.5), (5, 0, 1.5)).clear[0]


def test_a_person_on_the_link_costs_15_db_and_one_beside_it_nothing():
    on, beside = np.array([[[2.0, 0.0]]]), np.array([[[2.0, 0.3]]])
    assert look(Mine.build(), (0, 0, 1), (4, 0, 1), on).loss_db[0] == pytest.approx(15.0)
    assert look(Mine.build(), (0, 0, 1), (4, 0, 1), beside).clear[0]


coordinate = st.floats(-10, 10).map(lambda value: round(value, 3))


@given(st.tuples(coordinate, coordinate), st.tuples(coordinate, coordinate))
def test_share_inside_a_bent_polygon_agrees_with_sampling(start, end):
    corners = np.array([[-5.0, -5], [5, -5], [5, 5], [0, 0], [-5, 5]]) + np.pi * 1e-4  # no ray along an edge
    bent = ConvexPrisms.of([Prism(corners * [1.0, np.exp(0.01)], 0.0, 2.0)])
    a, b = np.array([[*start, 1.0]]), np.array([[*end, 1.0]])
    share = (np.arange(4000) + 0.5) / 4000
    sampled = contains(bent, a + share[:, None] * (b - a)).mean()
    spans = bent.spans(a, b)
    assert (spans[..., 1] - spans[..., 0]).sum() == pytest.approx(sampled, abs=2e-3)


@given(coordinate, coordinate)
def test_a_link_meets_the_same_in_both_directions(x, y):
    forth, back = look(L_MINE, (10, 0, 1), (x, y, 1)), look(L_MINE, (x, y, 1), (10, 0, 1))
    assert forth.rock_m[0] == pytest.approx(back.rock_m[0], abs=1e-6)
