import itertools
from pathlib import Path

import numpy as np
import pytest

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.site import Gallery, Obstacle, Site, load_site
from mine_loc_sim.prism import ConvexPrisms, contains
from mine_loc_sim.route_network import RouteNetwork
from mine_loc_sim.site_mine import mine_of

CONFIG = Path(__file__).parents[3] / "config"
SITES = ("example_mine", "laboratory", "gallery_2km", "vehicle", "trek_lab")


def network(site: Site) -> RouteNetwork:
    return RouteNetwork(site, mine_of(site).obstacle_parts)


def along(points: np.ndarray) -> np.ndarray:
    """Places every half metre or so on the way."""
    shares = np.linspace(0.0, 1.0, 200)[:, None]
    return np.concatenate([a + shares * (b - a) for a, b in itertools.pairwise(points)])


@pytest.mark.parametrize("name", SITES)
def test_ways_are_as_long_as_asked_for_and_pass_no_obstacle(name: str):
    site = load_site(CONFIG / name)
    obstacles = mine_of(site).obstacle_parts
    for seed in range(5):
        way = network(site).walk(np.random.default_rng(seed), 300.0)
        points = np.array([each.position_m for each in way])
        assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() >= 300.0
        assert not contains(obstacles, along(points) + np.array([0.0, 0.0, 1.0])).any()


@pytest.mark.parametrize("name", ["example_mine", "gallery_2km"])
def test_ways_stay_inside_galleries_and_chambers(name: str):
    site = load_site(CONFIG / name)
    free = mine_of(site).free
    for seed in range(5):
        points = np.array([each.position_m for each in network(site).walk(np.random.default_rng(seed), 500.0)])
        assert contains(free, along(points) + np.array([0.0, 0.0, 1.0])).mean() > 0.999


def test_a_branch_that_begins_on_another_gallerys_leg_can_be_entered():
    main = Gallery("main", ((0.0, 0.0, 0.0), (40.0, 0.0, 0.0)), 4.0, 3.0)
    branch = Gallery("branch", ((20.0, 0.0, 0.0), (20.0, 30.0, 0.0)), 4.0, 3.0)
    site = Site("t", "map", 2, 1.0, galleries=(main, branch))
    points = np.array([each.position_m for each in network(site).walk(np.random.default_rng(1), 800.0)])
    assert points[:, 1].max() > 25.0
    assert points[:, 0].min() < 5.0
    assert points[:, 0].max() > 35.0


def test_a_blocked_gallery_is_turned_back_in():
    main = Gallery("main", ((0.0, 0.0, 0.0), (40.0, 0.0, 0.0)), 4.0, 3.0)
    block = Obstacle("fall", ((25.0, -2.0), (26.0, -2.0), (26.0, 2.0), (25.0, 2.0)), 0.0, 3.0, "rock")
    site = Site("t", "map", 2, 1.0, galleries=(main,), obstacles=(block,))
    points = np.array([each.position_m for each in network(site).walk(np.random.default_rng(1), 200.0)])
    assert np.all(points[:, 0] < 25.0) or np.all(points[:, 0] > 26.0)


def test_a_site_that_is_all_obstacle_is_refused():
    main = Gallery("main", ((0.0, 0.0, 0.0), (40.0, 0.0, 0.0)), 4.0, 3.0)
    block = Obstacle("fall", ((-9.0, -9.0), (49.0, -9.0), (49.0, 9.0), (-9.0, 9.0)), 0.0, 3.0, "rock")
    site = Site("t", "map", 2, 1.0, galleries=(main,), obstacles=(block,))
    with pytest.raises(ConfigurationError, match="room to walk"):
        network(site).walk(np.random.default_rng(1), 200.0)


def test_the_same_generator_gives_the_same_way():
    site = load_site(CONFIG / "gallery_2km")
    assert network(site).walk(np.random.default_rng(4), 99.0) == network(site).walk(np.random.default_rng(4), 99.0)


def test_obstacles_may_be_none():
    site = load_site(CONFIG / "trek_lab")
    assert len(RouteNetwork(site, ConvexPrisms.of(())).walk(np.random.default_rng(0), 20.0)) > 1
