"""The front of the body: found from the rhythm of walking, however the sensor sits, with an honest variance."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_core import quaternion
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_pdr.dead_reckoning import ImuSample, PedestrianDeadReckoning
from mine_loc_pdr.mounting import FORWARD_PHASE_RAD, MEMORY_STEPS, FrontFinder, forward_push
from mine_loc_pdr.stride import PendulumStrideModel

STEP_HZ = 1.8
START_NS = 1_700_000_000 * NS_PER_S


def walking(seconds, q=(1.0, 0.0, 0.0, 0.0), front_yaw=0.0, rest_s=1.0):
    """Samples of somebody who is pushed towards `front_yaw` and sways sideways, the sensor turned by `q`."""
    t = np.arange(-100 * rest_s, 100 * seconds) / 100
    moving = t > 0
    phase = math.tau * STEP_HZ * t
    push, sway = 0.8 * np.sin(phase + FORWARD_PHASE_RAD), 0.6 * np.sin(0.5 * phase + 0.4)
    c, s = math.cos(front_yaw), math.sin(front_yaw)
    body = np.column_stack((c * push - s * sway, s * push + c * sway, 2.5 * np.sin(phase))) * moving[:, None]
    force = quaternion.rotate(q, body + np.array((0.0, 0.0, 9.80665)))
    return [
        ImuSample(START_NS + k * 10 * NS_PER_MS, (0.0, 0.0, 0.0), tuple(map(float, f))) for k, f in enumerate(force)
    ]


def walked(samples):
    pdr = PedestrianDeadReckoning(PendulumStrideModel(1.75))
    for sample in samples:
        pdr.push(sample)
    return pdr


@pytest.mark.parametrize("yaw_deg", [0, 70, 180, -120])
def test_the_front_is_where_the_steps_push_and_not_where_the_body_sways(yaw_deg):
    front = walked(walking(15.0, front_yaw=math.radians(yaw_deg))).front
    assert abs(math.remainder(front.yaw_rad - math.radians(yaw_deg), math.tau)) < math.radians(8.0)
    assert front.variance_rad2 < math.radians(10.0) ** 2


angles = st.floats(-3.1, 3.1)


@settings(max_examples=15)
@given(st.builds(quaternion.from_euler_zyx, angles, st.floats(-1.5, 1.5), angles))
def test_the_mounting_found_turns_the_front_of_the_sensor_into_the_front_of_the_body(q):
    pdr = walked(walking(15.0, q))
    base_from_imu = pdr.mounting(pdr.front.yaw_rad)
    front = quaternion.rotate(base_from_imu, quaternion.rotate(q, (1.0, 0.0, 0.0)))
    up = quaternion.rotate(base_from_imu, quaternion.rotate(q, (0.0, 0.0, 1.0)))
    assert front[0] > math.cos(math.radians(10.0))
    assert up[2] > math.cos(math.radians(3.0))


def test_before_six_steps_and_while_standing_there_is_no_front():
    assert walked(walking(2.0)).front is None
    assert walked(walking(0.0, rest_s=30.0)).front is None


def test_pushes_without_a_common_direction_find_no_front():
    finder = FrontFinder()
    for k in range(200):
        finder.add(complex(math.cos(2.4 * k), math.sin(2.4 * k)))
    assert finder.estimate() is None


def test_more_steps_that_agree_make_the_front_surer_down_to_how_people_differ():
    rng = np.random.default_rng(1)
    finder, deviations = FrontFinder(), []
    for k in range(200):
        finder.add(complex(1.0 + 0.4 * rng.standard_normal(), 0.4 * rng.standard_normal()))
        if k in (9, 50, 199):
            deviations.append(finder.estimate().variance_rad2 ** 0.5)
    assert deviations[0] > deviations[1] > deviations[2] > math.radians(5.0)


def test_a_sensor_that_slid_along_the_belt_is_found_at_its_new_place():
    finder = FrontFinder()
    for _ in range(3 * MEMORY_STEPS):
        finder.add(1.0)
    for _ in range(3 * MEMORY_STEPS):
        finder.add(1j)
    assert finder.estimate().yaw_rad == pytest.approx(math.pi / 2, abs=math.radians(5.0))


def test_the_push_does_not_depend_on_how_many_samples_a_step_has():
    pushes = []
    for n in (25, 100):
        phase = (1 + np.arange(n)) * math.tau / n
        motion = np.column_stack((np.sin(phase + 2.0), np.zeros(n), np.sin(phase)))
        pushes.append(forward_push(phase, motion))
    assert pushes[0] == pytest.approx(pushes[1])
