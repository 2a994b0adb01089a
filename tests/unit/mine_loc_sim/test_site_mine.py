"""Site files as radio sees them."""

import numpy as np
import pytest

from mine_loc_core.site import Chamber, Gallery, Obstacle, Site, Vehicle
from mine_loc_sim.site_mine import mine_of, vehicle_prism

GALLERY = Gallery("main", ((0.0, 0.0, 0.0), (40.0, 0.0, 0.0)), 4.0, 3.0)
BRANCH = Gallery("branch", ((40.0, 0.0, 0.0), (40.0, 30.0, 0.0)), 4.0, 3.0)
CHAMBER = Chamber("room", ((35.0, 28.0), (45.0, 28.0), (45.0, 38.0), (35.0, 38.0)), 0.0, 4.0)


def site(**parts):
    return Site("test", "map", 2, 1.0, **parts)


def look(mine, start, end):
    return mine.look(np.array([start], float), np.array([end], float))


def test_galleries_that_meet_and_their_chamber_are_one_hollow():
    mine = mine_of(site(galleries=(GALLERY, BRANCH), chambers=(CHAMBER,)))
    assert look(mine, (40, 0.5, 1), (41, 36, 1)).clear[0]
    around = look(mine, (5, 0, 1.5), (40, 34, 1.5))
    assert around.rock_m[0] > 1.0
    assert around.detour_m[0] == pytest.approx(35.0 + 34.0 - np.hypot(35, 34), abs=0.1)
    assert around.corners[0] == 1


def block(height_m):
    return Obstacle("block", ((20.0, -2.0), (21.0, -2.0), (21.0, 2.0), (20.0, 2.0)), 0.0, height_m, "concrete")


def test_over_an_obstacle_that_reaches_the_roof_no_way_leads():
    low = mine_of(site(galleries=(GALLERY,), obstacles=(block(2.0),)))
    full = mine_of(site(galleries=(GALLERY,), obstacles=(block(3.0),)))
    assert look(low, (5, 0, 1), (35, 0, 1)).detour_m[0] < 0.1
    assert look(full, (5, 0, 1), (35, 0, 1)).detour_m[0] == pytest.approx(2 * np.hypot(15, 2) - 30, abs=0.05)


def test_a_vehicle_blocks_links_where_it_stands_and_nowhere_else():
    vehicle = Vehicle("car", (8.0, 2.0, 1.5), (0.0, 0.0, 0.0), 0.0, ())
    mine = mine_of(site(galleries=(GALLERY,)))
    parked = mine.with_obstacles([vehicle_prism(vehicle, 20.0, 0.0, 0.0, np.pi / 2)])
    assert not look(parked, (18.5, 0, 1), (21.5, 0, 1)).clear[0]
    assert look(parked, (17.0, 0, 1), (18.5, 0, 1)).clear[0]
    assert look(mine, (18.5, 0, 1), (21.5, 0, 1)).clear[0]
