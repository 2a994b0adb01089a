"""The scale of the steps, refined from good UWB stretches: found within its variance, nothing learnt of bad ones."""

import cmath
import math

import numpy as np
import pytest

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_pdr.dead_reckoning import ImuSample, PedestrianDeadReckoning
from mine_loc_pdr.stride import PENDULUM_SCALE_VARIANCE, PendulumStrideModel
from mine_loc_pdr.stride_refinement import Fix, StrideRefiner

STEP_NS = 550 * NS_PER_MS


class Walker:
    """Somebody who takes steps of 0.7 m, dead-reckoned with K and in an odom turned against the map."""

    def __init__(self, true_scale=1.0, sd_m=0.1, seed=0):
        self.refiner = StrideRefiner(1.0, PENDULUM_SCALE_VARIANCE)
        self.true_scale, self.sd_m, self.rng = true_scale, sd_m, np.random.default_rng(seed)
        self.now_ns, self.true_m, self.reckoned_m = NS_PER_S, 0j, 0j

    def walk(self, steps, heading_rad=0.0, variance_m2=None, fixes=True, jump_m=0.0):
        """Take steps; a position at the middle and the end of each. What came of it."""
        found = []
        for k in range(steps):
            way = cmath.rect(0.7, heading_rad)
            for share in (0.5, 1.0):
                noise = self.sd_m * complex(*self.rng.standard_normal(2))
                place = self.true_m + share * way + noise + (jump_m if k > steps // 2 else 0.0)
                if fixes:
                    stamp_ns = self.now_ns + round(share * STEP_NS)
                    self.refiner.fix(Fix(stamp_ns, place, self.sd_m**2 if variance_m2 is None else variance_m2))
            self.now_ns += STEP_NS
            self.true_m += way
            self.reckoned_m += way * cmath.rect(self.refiner.known.scale / self.true_scale, -0.8)
            result = self.refiner.step(self.now_ns, self.reckoned_m, first=k == 0)
            if result is not None:
                found.append(result)
        return found


@pytest.mark.parametrize("true_scale", [0.9, 1.0, 1.12])
def test_the_scale_is_found_within_its_deviation_whatever_odom_is_turned_by(true_scale):
    walker = Walker(true_scale)
    found = walker.walk(200)
    assert len(found) >= 8
    assert found[-1].scale == pytest.approx(true_scale, abs=2.0 * math.sqrt(found[-1].variance) + 0.01)
    assert found[-1].variance < 0.2 * PENDULUM_SCALE_VARIANCE
    assert 150 < found[-1].steps_used <= 200


def test_the_stated_variance_is_that_of_the_error():
    """Eighty people whose scale is drawn from the prior, each stretch's own scale from walk to walk."""
    squared = []
    for seed in range(80):
        rng = np.random.default_rng(1000 + seed)
        true = 1.0 + math.sqrt(PENDULUM_SCALE_VARIANCE) * rng.standard_normal()
        walker = Walker(true, seed=seed)
        for _ in range(5):
            walker.true_scale = true * (1.0 + 0.04 * rng.standard_normal())
            walker.walk(25)
        squared.append((walker.refiner.known.scale - true) ** 2 / walker.refiner.known.variance)
    assert 0.6 < np.mean(squared) < 1.5


def test_a_bend_on_the_way_does_no_harm():
    walker = Walker(1.1)
    for k in range(12):
        walker.walk(25, heading_rad=0.4 * k)
    assert walker.refiner.known.scale == pytest.approx(1.1, abs=0.04)


@pytest.mark.parametrize("variance_m2", [0.5, math.nan, math.inf])
def test_of_positions_that_are_not_sure_nothing_is_learnt(variance_m2):
    walker = Walker(1.2)
    assert walker.walk(100, variance_m2=variance_m2) == []
    assert walker.walk(100, fixes=False) == []
    assert walker.refiner.known.scale == 1.0


def test_a_stretch_on_which_the_positions_jump_is_refused_and_counted():
    walker = Walker()
    assert walker.walk(19, jump_m=3j) == []
    assert walker.refiner.verdicts == {"unlike": 1}


def test_a_scale_nobody_has_is_refused_and_counted():
    walker = Walker(2.0)
    assert walker.walk(60) == []
    assert walker.refiner.verdicts["beyond_gate"] >= 1


def test_standing_and_silence_break_a_stretch():
    walker = Walker(1.1)
    for _ in range(20):
        assert walker.walk(10) == []
    quiet = Walker(1.1)
    for _ in range(20):
        assert quiet.walk(10) == []
        quiet.now_ns += 5 * NS_PER_S
    assert walker.refiner.verdicts == quiet.refiner.verdicts == {}


def test_a_new_scale_makes_later_steps_longer_moves_nobody_and_leaves_the_covariance_sound():
    pdr, lengths = PedestrianDeadReckoning(PendulumStrideModel(1.75)), []
    for k in range(3000):
        up = 9.80665 + (2.5 * math.sin(math.tau * 0.018 * k) if k > 100 else 0.0)
        steps = pdr.push(ImuSample(k * 10 * NS_PER_MS, (0.0, 0.0, 0.0), (0.0, 0.0, up)))
        lengths += [step.length_m for step in steps]
        if k == 1500:
            before = pdr.pose()
            pdr.rescale(1.1, 0.01**2)
            after = pdr.pose()
            half = len(lengths)
    assert (after.x_m, after.y_m) == (before.x_m, before.y_m)
    np.testing.assert_allclose(after.covariance, before.covariance)
    assert np.mean(lengths[half:]) == pytest.approx(1.1 * np.mean(lengths[5:half]), rel=0.01)
    assert np.linalg.eigvalsh(pdr.pose().covariance).min() > 0.0
