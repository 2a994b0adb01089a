"""Ringing begins with the strikes, is alike after each and dies away."""

import numpy as np
import pytest

from mine_loc_pdr.ringing import ringing

TIMES_S = np.arange(500) * 0.02
STRIKES_S = np.arange(2.0, 6.0, 0.5)


def rings(seed, strikes_s=STRIKES_S):
    return ringing(np.random.default_rng(seed), TIMES_S, strikes_s)


@pytest.mark.parametrize("seed", range(20))
def test_each_strike_sets_off_the_same_up_to_the_sign_of_the_foot(seed):
    motion = rings(seed)
    assert motion.shape == (500, 3)
    assert not motion[TIMES_S < 1.99].any()
    assert 0.0 < np.linalg.norm(motion, axis=1).max() <= 8.0
    one, other, third = (motion[100 + 25 * k : 124 + 25 * k] for k in range(3))
    np.testing.assert_allclose(third, one, atol=1e-9)
    np.testing.assert_allclose(np.abs(other), np.abs(one), atol=1e-9)


@pytest.mark.parametrize("seed", range(20))
def test_after_the_last_strike_it_dies_away(seed):
    strength = np.linalg.norm(rings(seed), axis=1)
    assert strength[-50:].max() < 0.3 * strength.max()


def test_without_a_strike_nothing_rings():
    assert not rings(0, np.empty(0)).any()
