import numpy as np
import pytest

from mine_loc_core.stamps import NS_PER_S
from mine_loc_sim import bearing_constants as bc
from mine_loc_sim.random_walk import RandomWalk

LOW_M, HIGH_M = np.array([0.0, 100.0]), np.array([300.0, 700.0])
STAMPS = np.arange(0, 3600 * NS_PER_S, NS_PER_S)


def walk(seed: int, high_m: np.ndarray = HIGH_M) -> np.ndarray:
    return RandomWalk(np.random.default_rng(seed), LOW_M, high_m, 3600.0)(STAMPS)


def test_a_node_walks_at_its_speed_and_never_leaves_the_field():
    places = walk(1)
    assert np.all((places[:, :2] >= LOW_M) & (places[:, :2] <= HIGH_M))
    steps_m = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert np.max(steps_m) <= bc.SPEED_M_S + 1e-9
    assert np.median(steps_m) == pytest.approx(bc.SPEED_M_S)


def test_on_a_wide_field_a_node_strays_as_far_as_independent_legs_take_it():
    far = np.array([1e6, 1e6])
    strayed_m = [np.linalg.norm(places[-1] - places[0]) for places in (walk(seed, far) for seed in range(300))]
    leg_m = bc.SPEED_M_S * bc.LEG_NS / NS_PER_S
    assert np.sqrt(np.mean(np.square(strayed_m))) == pytest.approx(np.sqrt(60) * leg_m, rel=0.1)


def test_nodes_begin_anywhere_in_the_field():
    starts = np.array([walk(seed)[0, :2] for seed in range(200)])
    assert np.mean(starts, axis=0) == pytest.approx((LOW_M + HIGH_M) / 2.0, rel=0.1)
