"""Ranges, classes and losses as they fall out of geometry and received signal, with and without accumulators."""

import numpy as np
import pytest

from mine_loc_sim.mine import Mine
from mine_loc_sim.prism import Prism
from mine_loc_sim.radio_constants import OFFICE
from mine_loc_sim.range_law import FastTagLinks
from mine_loc_sim.ranging_link import LinkClass, Radios, TagLinks
from mine_loc_sim.wearer import Wearer

NOBODY = Wearer(loss_db=0.0, delay_m=0.0)
ROUNDS = 12


def wall(material, thickness_m):
    return Mine.build(
        obstacles=[Prism(np.array([[2, -9], [2 + thickness_m, -9], [2 + thickness_m, 9], [2, 9]]), 0, 9, material)]
    )


def rounds(mine, distance_m=5.0, links=40, kind=TagLinks, wearer=NOBODY, facing_rad=0.0, seed=1):
    """Range `links` anchors, all at one distance to the east, ROUNDS times; errors (ROUNDS, links) and the ranges."""
    rng = np.random.default_rng(seed)
    tag = kind(OFFICE, Radios.draw(1, rng), Radios.draw(links, rng), wearer, rng)
    tag_m = np.tile([0.0, 0.0, 1.0], (ROUNDS, 1))
    anchor_m = np.tile([distance_m, 0.0, 1.0], (ROUNDS, links, 1))
    ways = mine.look(np.repeat(tag_m, links, axis=0), anchor_m.reshape(-1, 3))
    ranges = tag.measure(tag_m, np.full(ROUNDS, facing_rad), anchor_m, np.tile(np.arange(links), (ROUNDS, 1)), ways)
    return (ranges.range_m - distance_m).reshape(ROUNDS, links), ranges


@pytest.fixture(scope="module")
def clear():
    return rounds(Mine.build(), links=120)


def test_clear_links_have_a_small_bias_each_and_centimetres_of_white_noise(clear):
    error_m, ranges = clear
    assert 0.08 < np.median(error_m, axis=0).std() < 0.20
    assert 0.012 < np.median(error_m.std(axis=0)) < 0.03
    assert set(np.unique(ranges.link_class)) <= {LinkClass.CLEAR, LinkClass.CLEAR_DISTURBED}


def test_both_clear_classes_occur_and_the_disturbed_one_errs_more(clear):
    _, ranges = clear
    error_m = np.abs(ranges.exchanges.error_m)
    assert np.median(error_m[ranges.link_class == LinkClass.CLEAR]) < 0.06
    assert np.median(error_m[ranges.link_class == LinkClass.CLEAR_DISTURBED]) > 0.09


def test_a_thin_wooden_wall_leaves_an_obstructed_direct_path():
    error_m, ranges = rounds(wall("wood", 0.2))
    assert np.mean(ranges.link_class == LinkClass.OBSTRUCTED) > 0.5
    assert np.median(error_m) > 0.05


def test_a_steel_wall_leaves_no_direct_path_and_only_long_ranges():
    error_m, ranges = rounds(wall("steel", 0.2))
    assert np.all(ranges.link_class == LinkClass.NO_DIRECT_PATH)
    assert ranges.received.mean() > 0.5
    assert np.nanquantile(error_m, 0.02) > 0.1


def test_a_wearer_facing_away_is_measured_too_far():
    wearer = Wearer(loss_db=20.0, delay_m=0.5)
    front, _ = rounds(Mine.build(), wearer=wearer)
    back, ranges = rounds(Mine.build(), wearer=wearer, facing_rad=np.pi)
    assert np.nanmedian(back) > np.nanmedian(front) + 0.15
    assert np.all(ranges.link_class <= LinkClass.OBSTRUCTED)


@pytest.mark.parametrize("kind", [TagLinks, FastTagLinks])
def test_beyond_sensitivity_rounds_are_lost_and_say_so(kind):
    rock = Mine.build(free=[Prism(np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]), 0, 3)])
    error_m, ranges = rounds(rock, distance_m=60.0, links=10, kind=kind)
    assert not ranges.received.any()
    assert np.isnan(error_m).all()


@pytest.mark.parametrize("kind", [TagLinks, FastTagLinks])
def test_the_same_seed_gives_the_same_ranges(kind):
    first, _ = rounds(wall("wood", 0.2), links=4, kind=kind, seed=9)
    again, _ = rounds(wall("wood", 0.2), links=4, kind=kind, seed=9)
    other, _ = rounds(wall("wood", 0.2), links=4, kind=kind, seed=10)
    assert np.array_equal(first, again, equal_nan=True)
    assert not np.array_equal(first, other, equal_nan=True)


def test_the_bias_of_a_link_fades_with_the_way_walked():
    rng = np.random.default_rng(4)
    links = TagLinks(OFFICE, Radios.draw(1, rng), Radios.draw(200, rng), NOBODY, rng)
    x_m = np.array([0.0, 0.01, 3.0])
    tag_m = np.column_stack([x_m, np.zeros(3), np.ones(3)])
    anchor_m = np.tile([10.0, 0.0, 1.0], (3, 200, 1))
    ways = Mine.build().look(np.repeat(tag_m, 200, axis=0), anchor_m.reshape(-1, 3))
    ranges = links.measure(tag_m, np.zeros(3), anchor_m, np.tile(np.arange(200), (3, 1)), ways)
    error_m = ranges.exchanges.error_m.reshape(3, 200)
    near, far = np.corrcoef(error_m[0], error_m[1])[0, 1], np.corrcoef(error_m[0], error_m[2])[0, 1]
    assert near > 0.5
    assert abs(far) < 0.3


@pytest.mark.parametrize(("mine", "low", "high"), [(Mine.build(), 0.08, 0.35), (wall("concrete", 0.1), 0.15, 1.6)])
def test_ranges_without_accumulators_have_the_same_spread(mine, low, high):
    full, _ = rounds(mine, links=150)
    fast, _ = rounds(mine, links=150, kind=FastTagLinks)
    middles = [np.nanmedian(error_m, axis=0) for error_m in (full, fast)]
    for middle in middles:
        quartiles = np.nanquantile(middle, [0.05, 0.5, 0.95])
        assert low < quartiles[2] - quartiles[0] < high * 2.0
    assert np.nanmedian(middles[0]) == pytest.approx(np.nanmedian(middles[1]), abs=0.12)
