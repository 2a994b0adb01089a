import itertools
import math

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

from mine_loc_core.stamps import NS_PER_S, to_ns
from mine_loc_sim import gait_constants as gc
from mine_loc_sim.gait import draw_person
from mine_loc_sim.route import WayPoint, plan_route
from mine_loc_sim.walker import Walker

CORNERS = [
    WayPoint((0.0, 0.0, 0.0), pause_s=4.0),
    WayPoint((25.0, 0.0, 0.0)),
    WayPoint((25.0, 15.0, 1.0)),
    WayPoint((25.0, 0.0, 0.0), pause_s=4.0),
]

MOTION = ("position_m", "velocity_m_s", "orientation_wxyz", "specific_force_m_s2", "angular_rate_rad_s")


def walker(seed=1, points=CORNERS, start_ns=0, **given):
    rng = np.random.default_rng(seed)
    person = draw_person(rng, **given)
    return Walker(person, plan_route(points, person.preferred_speed_m_s), rng, start_ns)


def stamps(w, rate_hz=100.0):
    return w.start_ns + np.rint(np.arange(0.0, w.duration_s * rate_hz) * NS_PER_S / rate_hz).astype(np.int64)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_acceleration_integrates_to_velocity_and_position_without_drift(seed):
    w = walker(seed)
    motion = w.motion(stamps(w, 1000.0))
    velocity = motion.velocity_m_s[0] + cumulative_trapezoid(motion.acceleration_m_s2, dx=1e-3, axis=0, initial=0)
    position = motion.position_m[0] + cumulative_trapezoid(velocity, dx=1e-3, axis=0, initial=0)
    np.testing.assert_allclose(velocity, motion.velocity_m_s, atol=5e-5)
    np.testing.assert_allclose(position, motion.position_m, atol=5e-4)


def test_an_ideal_imu_navigates_back_to_the_truth():
    w = walker(2)
    rate_hz = 400.0
    ends = stamps(w, rate_hz)
    truth, middle = w.motion(ends), w.motion((ends[1:] + ends[:-1]) // 2)
    turn = Rotation.from_rotvec(middle.angular_rate_rad_s / rate_hz).as_matrix()
    half = Rotation.from_rotvec(middle.angular_rate_rad_s / rate_hz / 2)
    in_middle = half.apply(middle.specific_force_m_s2)
    first, last = (Rotation.from_quat(truth.orientation_wxyz[i, [1, 2, 3, 0]]) for i in (0, -1))
    attitude, velocity, position = first.as_matrix(), truth.velocity_m_s[0].copy(), truth.position_m[0].copy()
    for i in range(len(turn)):
        acceleration = attitude @ in_middle[i] - [0, 0, gc.GRAVITY_M_S2]
        position += (velocity + acceleration / rate_hz / 2) / rate_hz
        velocity += acceleration / rate_hz
        attitude = attitude @ turn[i]
    tilt = (Rotation.from_matrix(attitude).inv() * last).magnitude()
    assert tilt < 5e-5
    assert np.linalg.norm(velocity - truth.velocity_m_s[-1]) < 0.01
    assert np.linalg.norm(position - truth.position_m[-1]) < 0.2


def test_the_same_seed_gives_the_same_samples_and_another_seed_others():
    first, again, other = walker(1), walker(1), walker(4)
    at = stamps(first)
    whole = first.motion(at)
    repeated = again.motion(at)
    for name in MOTION:
        np.testing.assert_array_equal(getattr(whole, name), getattr(repeated, name))
    assert first.steps() == again.steps()
    assert not np.array_equal(whole.position_m, other.motion(at).position_m)


def test_blocks_of_any_size_join_without_a_seam():
    w = walker(1)
    at = stamps(w)
    whole = w.motion(at)
    pieces = [w.motion(block) for block in np.array_split(at, 7)]
    for name in MOTION:
        np.testing.assert_allclose(getattr(whole, name), np.concatenate([getattr(p, name) for p in pieces]), atol=1e-12)


def test_left_and_right_steps_alternate_and_their_lengths_add_up_to_the_way():
    steps = walker(3).steps()
    feet = [s.foot for s in steps]
    assert all(a != b for a, b in itertools.pairwise(feet))
    assert all(a.stamp_ns < b.stamp_ns for a, b in itertools.pairwise(steps))
    assert sum(s.length_m for s in steps) == pytest.approx(25 + 2 * math.hypot(15, 1), rel=0.02)


def test_steady_steps_obey_the_persons_own_law_with_scatter():
    far = [WayPoint((0.0, 0.0, 0.0), pause_s=3.0), WayPoint((400.0, 0.0, 0.0), pause_s=3.0)]
    w = walker(5, far, height_m=1.80, preferred_speed_m_s=1.3)
    steps = w.steps()[10:-10]
    frequency = len(steps[1:]) / ((steps[-1].stamp_ns - steps[0].stamp_ns) / NS_PER_S)
    lengths = np.array([s.length_m for s in steps[1:]])
    assert lengths.mean() == pytest.approx(float(w.person.law.length_m(np.array(frequency))), rel=0.01)
    assert frequency * lengths.mean() == pytest.approx(1.3, rel=0.01)
    assert lengths.std() / lengths.mean() == pytest.approx(gc.STEP_LENGTH_CV, rel=0.35)


def test_step_times_scatter_and_one_foot_is_slower_as_the_person_is():
    far = [WayPoint((0.0, 0.0, 0.0), pause_s=3.0), WayPoint((600.0, 0.0, 0.0), pause_s=3.0)]
    w = walker(6, far)
    steps = w.steps()[10:-10]
    times = np.diff([s.stamp_ns for s in steps]) / NS_PER_S
    left = np.array([s.foot == "left" for s in steps[1:]])
    asymmetry = (times[left].mean() - times[~left].mean()) / times.mean()
    assert asymmetry == pytest.approx(w.person.step_time_asymmetry, abs=0.006)
    assert times[left].std() / times.mean() == pytest.approx(gc.STEP_TIME_CV, rel=0.2)


def test_the_waist_bobs_once_a_step_and_swings_sideways_once_a_stride():
    far = [WayPoint((0.0, 0.0, 0.0), pause_s=3.0), WayPoint((120.0, 0.0, 0.0), pause_s=3.0)]
    w = walker(7, far, preferred_speed_m_s=1.3)
    at = stamps(w)[1000:-1000]
    motion = w.motion(at)
    steps = [s for s in w.steps() if at[0] <= s.stamp_ns <= at[-1]]
    step_hz = (len(steps) - 1) / ((steps[-1].stamp_ns - steps[0].stamp_ns) / NS_PER_S)
    frequencies = np.fft.rfftfreq(len(at), 0.01)

    def loudest(position):
        spectrum = np.abs(np.fft.rfft((position - position.mean()) * np.hanning(len(at))))
        return frequencies[np.argmax(np.where(frequencies > 0.6, spectrum, 0.0))]

    assert loudest(motion.position_m[:, 2]) == pytest.approx(step_hz, abs=0.05)
    assert loudest(motion.position_m[:, 1]) == pytest.approx(step_hz / 2, abs=0.05)


def test_a_standing_person_sways_but_makes_no_step():
    w = walker(8)
    motion = w.motion(to_ns(0.5) + np.arange(200) * to_ns(0.01))
    assert not [s for s in w.steps() if s.stamp_ns < to_ns(2.5)]
    assert 0.0 < np.abs(motion.angular_rate_rad_s).max() < 0.05
    np.testing.assert_allclose(np.linalg.norm(motion.specific_force_m_s2, axis=1), gc.GRAVITY_M_S2, atol=0.1)


def test_a_turn_is_reported_where_the_heading_turns_and_a_reversal_takes_a_few_steps():
    w = walker(9)
    right_angle, reversal = w.turns()
    assert right_angle.angle_rad == pytest.approx(math.pi / 2)
    assert reversal.angle_rad == pytest.approx(math.pi)
    for turn in (right_angle, reversal):
        before, after = w.motion(np.array([turn.start_ns, turn.stop_ns])).heading_rad
        assert after - before == pytest.approx(0.9 * turn.angle_rad, rel=0.02)
    whole = to_ns(0.3)
    steps = [s for s in w.steps() if reversal.start_ns - whole <= s.stamp_ns <= reversal.stop_ns + whole]
    assert 2 <= len(steps) <= 5


def test_the_start_moves_every_stamp():
    early, late = walker(1), walker(1, start_ns=1_700_000_000_000_000_000)
    shift = late.start_ns
    np.testing.assert_array_equal(early.motion(stamps(early)).position_m, late.motion(stamps(early) + shift).position_m)
    assert [s.stamp_ns + shift for s in early.steps()] == [s.stamp_ns for s in late.steps()]
    assert late.turns()[0].start_ns == early.turns()[0].start_ns + shift


def test_the_waist_is_carried_at_its_height_above_the_ground():
    w = walker(2, height_m=1.9)
    assert w.motion(stamps(w)).position_m[:200, 2].mean() == pytest.approx(0.58 * 1.9, abs=0.03)


def test_motion_far_outside_the_walk_is_standing_still():
    w = walker(2)
    outside = w.motion(np.array([-to_ns(60.0), to_ns(w.duration_s + 60.0)]))
    np.testing.assert_allclose(outside.velocity_m_s, 0.0, atol=1e-9)
    np.testing.assert_allclose(outside.position_m[1, :2], [25.0, 0.0], atol=0.05)
