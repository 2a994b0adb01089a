"""Changes of velocity: the integral of acceleration in odom, told only where there are no steps."""

import math

import numpy as np
import pytest

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_pdr.attitude import STANDARD_GRAVITY_M_S2
from mine_loc_pdr.dead_reckoning import ImuSample, PedestrianDeadReckoning
from mine_loc_pdr.stride import PendulumStrideModel
from mine_loc_pdr.velocity_changes import STEPLESS_NS, VelocityChanges

T0 = 10**18
PERIOD_NS = 10 * NS_PER_MS
LEVEL = (1.0, 0.0, 0.0, 0.0)
QUARTER_LEFT = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))


def play(subject, forces, orientation=LEVEL, start=0):
    """The changes that samples of force (n, 3), gravity added, complete, the first at `start` periods."""
    found = []
    for number, (x, y, z) in enumerate(forces, start):
        force = (x, y, z + STANDARD_GRAVITY_M_S2)
        found.append(subject.push(T0 + number * PERIOD_NS, 0.01, orientation, force))
    return [each for each in found if each is not None]


def test_a_constant_acceleration_is_told_every_tenth_of_a_second_as_its_product_with_time():
    first, second = play(VelocityChanges(), [(1.0, -2.0, 0.5)] * 21)
    assert (first.stamp_ns, second.stamp_ns) == (T0 + 10 * PERIOD_NS, T0 + 20 * PERIOD_NS)
    for change in (first, second):
        assert change.interval_s == pytest.approx(0.1)
        assert change.change_m_s == pytest.approx((0.1, -0.2, 0.05))


def test_the_changes_add_up_to_the_integral_of_what_varies():
    t_s = 0.01 * np.arange(101)
    changes = play(VelocityChanges(), np.column_stack([np.cos(3.0 * t_s), t_s, 0.0 * t_s]))
    total = np.sum([change.change_m_s for change in changes], axis=0)
    assert total == pytest.approx([math.sin(3.0) / 3.0, 0.5, 0.0], abs=1e-4)


def test_they_are_in_odom_whatever_way_the_sensor_looks():
    (change,) = play(VelocityChanges(), [(1.0, 0.0, 0.0)] * 11, QUARTER_LEFT)
    assert change.change_m_s == pytest.approx((0.0, 0.1, 0.0))


def test_after_a_step_nothing_is_told_until_there_was_none_for_long():
    subject = VelocityChanges()
    play(subject, [(1.0, 0.0, 0.0)] * 6)
    subject.stepped(T0 + 5 * PERIOD_NS)
    stepless = 6 + STEPLESS_NS // PERIOD_NS
    assert play(subject, [(1.0, 0.0, 0.0)] * (stepless - 6), start=6) == []
    (change,) = play(subject, [(1.0, 0.0, 0.0)] * 11, start=stepless)
    assert (change.interval_s, change.change_m_s[0]) == (pytest.approx(0.1), pytest.approx(0.1))


def test_what_was_summed_up_before_a_gap_is_left_out():
    subject = VelocityChanges()
    play(subject, [(5.0, 0.0, 0.0)] * 6)
    subject.interrupted()
    (change,) = play(subject, [(1.0, 0.0, 0.0)] * 11, start=100)
    assert (change.interval_s, change.change_m_s[0]) == (pytest.approx(0.1), pytest.approx(0.1))


def reckon(seconds, force):
    """Dead reckoning of a sensor whose force is told for each sample; steps, and changes with their sample's number."""
    pdr, steps, changes = PedestrianDeadReckoning(PendulumStrideModel(1.75)), [], []
    for number in range(round(100 * seconds)):
        steps += pdr.push(ImuSample(T0 + number * PERIOD_NS, (0.0, 0.0, 0.0), force(0.01 * number)))
        changes += [pdr.velocity_change] if pdr.velocity_change else []
    return steps, changes


def test_dead_reckoning_tells_of_a_push_without_steps():
    push = lambda t_s: (0.5 if 2.0 < t_s <= 3.0 else 0.0, 0.0, STANDARD_GRAVITY_M_S2)  # noqa: E731
    steps, changes = reckon(4.0, push)
    assert steps == []
    assert len(changes) == 34
    pushed = [change.change_m_s[0] for change in changes if 2.0 < (change.stamp_ns - T0) / NS_PER_S < 3.11]
    assert sum(pushed) == pytest.approx(0.5, rel=0.15)  # the horizon gives way


def test_dead_reckoning_tells_of_none_while_somebody_walks():
    walk = lambda t_s: (0.0, 0.0, STANDARD_GRAVITY_M_S2 + (2.5 * math.sin(11.0 * t_s) if t_s > 1.0 else 0.0))  # noqa: E731
    steps, changes = reckon(8.0, walk)
    assert len(steps) > 8
    assert max(change.stamp_ns for change in changes) < steps[1].stamp_ns + NS_PER_S // 2
