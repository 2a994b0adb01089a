"""Dead reckoning as a whole: drawn walks, broken input, and real lower-back recordings."""

import gzip
import json
import math
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_core import quaternion
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_pdr.dead_reckoning import ImuSample, PedestrianDeadReckoning
from mine_loc_pdr.steps import Step
from mine_loc_pdr.stride import LONGEST_STEP_SHARE, PendulumStrideModel, StrideModel

START_NS = 1_700_000_000 * NS_PER_S
PERIOD_NS = 10 * NS_PER_MS
G = 9.80665


def walk(legs, *, step_hz=1.8, mounting=(1.0, 0.0, 0.0, 0.0), bias=(0.0, 0.0, 0.0), rest_s=3.0, start_ns=START_NS):
    """Samples of a rest, then of legs of (seconds, yaw rate rad/s) walked, with the IMU worn as `mounting`."""
    rates = np.repeat([0.0, *[leg[1] for leg in legs]], [round(s * 100) for s in (rest_s, *[leg[0] for leg in legs])])
    t = np.arange(len(rates)) * 0.01 - rest_s
    vertical = G + np.where(t > 0, 2.5 * np.sin(2 * np.pi * step_hz * t), 0.0)
    imu_from_base = quaternion.conjugate(mounting)
    zero = np.zeros_like(t)
    gyro = quaternion.rotate(imu_from_base, np.column_stack((zero, zero, rates))) + bias
    force = quaternion.rotate(imu_from_base, np.column_stack((zero, zero, vertical)))
    return [
        ImuSample(start_ns + k * PERIOD_NS, tuple(map(float, w)), tuple(map(float, f)))
        for k, (w, f) in enumerate(zip(gyro, force, strict=True))
    ]


def push_all(samples, pdr=None, height_m=1.75):
    pdr = pdr or PedestrianDeadReckoning(StrideModel(height_m))
    return pdr, [event for sample in samples for event in pdr.push(sample)]


class TellsLate:
    """One step, five seconds after its strike: its motion is forgotten by then."""

    def push(self, stamp_ns, _):
        return [Step(START_NS + 2000 * NS_PER_MS, None, 0.9)] if stamp_ns == START_NS + 7000 * NS_PER_MS else ()

    def reset(self): ...


@pytest.mark.parametrize("walking_s", [0.0, 6.0])
def test_a_step_told_too_late_to_be_measured_leaves_a_sound_track(walking_s):
    pdr = PedestrianDeadReckoning(PendulumStrideModel(1.75), detector=TellsLate())
    _, (step,) = push_all(walk([(walking_s, 0.0)], rest_s=8.0 - walking_s), pdr)
    assert 0.0 <= step.length_m < 0.6
    assert np.all(np.linalg.eigvalsh(pdr.pose().covariance) >= 0.0)


def test_before_the_horizon_is_found_there_is_no_pose():
    pdr, _ = push_all(walk([(1.0, 0.0)])[:10])
    assert pdr.pose() is None


def test_a_straight_walk_goes_as_far_as_its_steps_are_long():
    pdr, steps = push_all(walk([(20.0, 0.0)]))
    pose = pdr.pose()
    assert len(steps) == pdr.step_count == 36
    assert [s.count for s in steps] == list(range(1, 37))
    assert pose.x_m == pytest.approx(sum(s.length_m for s in steps))
    assert (steps[-1].x_m, steps[-1].y_m) == (pose.x_m, pose.y_m)
    assert pose.x_m == pytest.approx(35.5 * 0.702, rel=0.01)  # with the first the waist goes half a step
    assert pose.y_m == pytest.approx(0.0, abs=1e-6)


class TellsTwoAtOnce:
    """Two steps, of half a second each, a third of a second after the second one's strike."""

    def push(self, stamp_ns, _):
        strikes_ns = [START_NS + 2500 * NS_PER_MS, START_NS + 3000 * NS_PER_MS]
        if stamp_ns != strikes_ns[1] + 330 * NS_PER_MS:
            return ()
        return [Step(strikes_ns[0], None, 0.9), Step(strikes_ns[1], 0.5, 0.9)]

    def reset(self): ...


def test_steps_told_together_lead_each_where_the_waist_faced_at_its_own_time():
    pdr = PedestrianDeadReckoning(StrideModel(1.75), detector=TellsTwoAtOnce())
    _, (first, second) = push_all(walk([(0.5, math.pi), (1.0, 0.0)], rest_s=2.5), pdr)
    assert (first.count, second.count) == (1, 2)
    assert first.heading_rad == pytest.approx(0.0, abs=0.02)
    assert second.heading_rad == pytest.approx(math.pi / 4, abs=0.05)
    assert (first.x_m, first.y_m) == (pytest.approx(first.length_m, abs=0.01), pytest.approx(0.0, abs=0.02))
    assert (pdr.pose().x_m, pdr.pose().y_m) == (second.x_m, second.y_m)
    assert second.x_m - first.x_m == pytest.approx(second.length_m * math.cos(second.heading_rad))


@pytest.mark.parametrize("roll_pitch", [(0.0, 0.0), (1.1, 0.2), (-0.4, -1.2), (3.0, 0.1)])
def test_a_left_turn_leads_to_the_left_however_the_imu_is_worn(roll_pitch):
    mounting = quaternion.from_euler_zyx(*roll_pitch, 0.0)
    pdr, steps = push_all(walk([(10.0, 0.0), (2.0, math.pi / 4), (10.3, 0.0)], mounting=mounting))
    pose = pdr.pose()
    assert steps[-1].heading_rad == pytest.approx(steps[3].heading_rad + math.pi / 2, abs=1e-3)
    first, last = np.array((math.cos(steps[3].heading_rad), math.sin(steps[3].heading_rad))), (pose.x_m, pose.y_m)
    speed_m_s = 1.8 * 0.702
    leg_and_radius_m = 10.0 * speed_m_s + speed_m_s / (math.pi / 4)
    assert np.dot(first, last) == pytest.approx(leg_and_radius_m, abs=0.8)
    assert first[0] * last[1] - first[1] * last[0] == pytest.approx(leg_and_radius_m, abs=0.8)


def test_standing_makes_no_step_and_no_way_while_the_heading_gets_less_sure():
    pdr, steps = push_all(walk([], rest_s=5.0))
    early = pdr.pose()
    push_all(walk([], rest_s=60.0, start_ns=START_NS + 5 * NS_PER_S), pdr)
    late = pdr.pose()
    assert steps == []
    assert (late.x_m, late.y_m) == (0.0, 0.0)
    assert late.covariance[2, 2] > early.covariance[2, 2] > 0.0


def test_rest_teaches_the_bias_so_that_a_later_walk_is_straighter():
    bias = (0.002, -0.003, 0.006)
    headings = {}
    for rest_s in (1.0, 30.0):
        _, steps = push_all(walk([(60.0, 0.0)], bias=bias, rest_s=rest_s))
        headings[rest_s] = steps[-1].heading_rad - steps[0].heading_rad
    assert headings[1.0] > 0.3
    assert abs(headings[30.0]) < 0.1 * headings[1.0]


def test_the_covariance_covers_a_bias_of_a_standard_deviation_unlearnt():
    pdr, _ = push_all(walk([(60.0, 0.0)], bias=(0.0, 0.0, 0.005), rest_s=0.6))
    pose = pdr.pose()
    assert abs(pose.yaw_rad) == pytest.approx(pose.covariance[2, 2] ** 0.5, rel=0.3)


def test_position_is_ever_less_sure_on_the_way():
    pdr, _ = push_all(walk([(5.0, 0.0)]))
    early = pdr.pose().covariance
    push_all(walk([(20.0, 0.0)], rest_s=0.0, start_ns=START_NS + 8 * NS_PER_S), pdr)
    late = pdr.pose().covariance
    assert np.all(np.diag(late) > np.diag(early))
    assert np.linalg.eigvalsh(early).min() > 0.0


def test_reading_the_pose_often_changes_nothing():
    samples = walk([(10.0, 0.1)])
    quiet, _ = push_all(samples)
    asked = PedestrianDeadReckoning(StrideModel(1.75))
    for sample in samples:
        asked.push(sample)
        asked.pose()
    assert asked.pose().x_m == quiet.pose().x_m
    np.testing.assert_allclose(asked.pose().covariance, quiet.pose().covariance, rtol=1e-3, atol=1e-9)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_a_number_is_dropped_and_counted(value):
    samples = walk([(10.0, 0.0)])
    clean, _ = push_all(samples)
    bad = ImuSample(samples[500].stamp_ns + 1, (0.0, value, 0.0), (0.0, 0.0, G))
    worse = ImuSample(samples[500].stamp_ns + 2, (0.0, 0.0, 0.0), (value, 0.0, G))
    pdr, _ = push_all([*samples[:501], bad, worse, *samples[501:]])
    assert pdr.faults == {"not_finite": 2}
    assert pdr.pose().x_m == clean.pose().x_m


def test_values_beyond_any_sensor_are_dropped_and_counted():
    samples = walk([(2.0, 0.0)])
    pdr, _ = push_all([*samples, ImuSample(samples[-1].stamp_ns + 1, (0.0, 0.0, 101.0), (0.0, 0.0, G))])
    pdr.push(ImuSample(samples[-1].stamp_ns + 2, (0.0, 0.0, 0.0), (0.0, 0.0, -1001.0)))
    assert pdr.faults == {"out_of_range": 2}


def test_duplicate_and_late_samples_are_dropped_and_counted():
    samples = walk([(10.0, 0.0)])
    clean, _ = push_all(samples)
    pdr, _ = push_all([*samples[:600], samples[599], samples[590], *samples[600:]])
    assert pdr.faults == {"duplicate": 1, "backward": 1}
    assert pdr.pose().x_m == clean.pose().x_m


def test_a_gap_is_counted_and_makes_the_position_less_sure():
    samples = walk([(20.0, 0.0)])
    clean, _ = push_all(samples)
    pdr, _ = push_all(samples[:1000] + samples[1200:])
    assert pdr.faults == {"gaps": 1}
    assert np.trace(pdr.pose().covariance[:2, :2]) > np.trace(clean.pose().covariance[:2, :2]) + 2 * (1.5 * 2.0) ** 2


def test_a_clock_set_back_is_counted_and_the_track_goes_on():
    pdr, before = push_all(walk([(10.0, 0.0)]))
    x_m = pdr.pose().x_m
    _, after = push_all(walk([(10.0, 0.0)], rest_s=0.0, start_ns=START_NS - 3600 * NS_PER_S), pdr)
    assert pdr.faults == {"clock_jumps": 1}
    assert after[0].count == before[-1].count + 1
    assert after[0].interval_s is None
    assert pdr.pose().x_m > x_m + 10.0


def test_free_fall_at_the_start_puts_the_start_off():
    floating = [ImuSample(START_NS + k * PERIOD_NS, (0.0, 0.0, 0.0), (0.0, 0.0, 0.1)) for k in range(60)]
    pdr, _ = push_all(floating)
    assert pdr.pose() is None
    assert pdr.faults == {"no_gravity": 1}
    push_all(walk([(5.0, 0.0)], start_ns=START_NS + NS_PER_S), pdr)
    assert pdr.pose().x_m > 2.0


def farthest_step_m(pdr, samples):
    """The largest change of position from one sample to the next, and the pose at the end."""
    farthest, place = 0.0, pdr.pose()
    for sample in samples:
        pdr.push(sample)
        now = pdr.pose()
        if place is not None and now is not None:
            farthest = max(farthest, math.hypot(now.x_m - place.x_m, now.y_m - place.y_m))
        place = now
    return farthest, place


def broken(samples, kind):
    """The samples of a walk as `kind` of trouble leaves them."""
    middle = len(samples) // 2
    if kind == "half rate":
        return samples[::2]
    if kind == "two seconds lost":
        return samples[:middle] + samples[middle + 200 :]
    if kind == "repeated":
        return [sample for sample in samples for _ in range(2)]
    if kind == "backward":
        return samples[:middle] + samples[middle - 50 : middle] + samples[middle:]
    if kind == "clock set back":
        late = [ImuSample(s.stamp_ns - 3600 * NS_PER_S, s.rate_rad_s, s.force_m_s2) for s in samples[middle:]]
        return samples[:middle] + late
    if kind == "saturated":
        clipped = [ImuSample(s.stamp_ns, (0.0, 0.0, 4.36), s.force_m_s2) for s in samples[middle : middle + 30]]
        return samples[:middle] + clipped + samples[middle + 30 :]
    knocks = [ImuSample(s.stamp_ns, s.rate_rad_s, (300.0, -300.0, 900.0 * (-1) ** (k // 25))) for k, s in
              enumerate(samples[middle : middle + 100])]  # fmt: skip
    return samples[:middle] + knocks + samples[middle + 100 :]


@pytest.mark.parametrize(
    ("kind", "fault"),
    [
        ("half rate", None),
        ("two seconds lost", "gaps"),
        ("repeated", "duplicate"),
        ("backward", "backward"),
        ("clock set back", "clock_jumps"),
        ("saturated", "saturated"),
        ("knocked", None),
    ],
)
def test_broken_input_moves_nobody_further_than_a_step_at_a_time(kind, fault):
    pdr = PedestrianDeadReckoning(PendulumStrideModel(1.75))
    samples = walk([(20.0, 0.0)])
    farthest, pose = farthest_step_m(pdr, broken(samples, kind))
    clean, _ = push_all(samples, PedestrianDeadReckoning(PendulumStrideModel(1.75)))
    assert farthest <= LONGEST_STEP_SHARE * 1.75 + 1e-9
    assert math.hypot(pose.x_m - clean.pose().x_m, pose.y_m - clean.pose().y_m) < clean.pose().x_m
    assert np.linalg.eigvalsh(pose.covariance).min() > 0.0
    if fault:
        assert pdr.faults[fault] > 0


def test_a_burst_after_half_a_second_of_silence_is_bridged_by_device_time():
    """The Wi-Fi bridge holds samples back and sends them at once: stamps tell when they were, arrival plays no part."""
    samples = walk([(20.0, 0.0)])
    clean, _ = push_all(samples)
    bridged = PedestrianDeadReckoning(StrideModel(1.75))
    for begin in range(0, len(samples), 50):
        for sample in samples[begin : begin + 50]:
            bridged.push(sample)
        assert not bridged.faults
    assert bridged.pose().x_m == clean.pose().x_m


@pytest.mark.parametrize(("lost", "declared"), [(10, {}), (15, {}), (25, {"gaps": 1}), (50, {"gaps": 1})])
def test_a_few_lost_samples_are_bridged_and_half_a_second_is_declared(lost, declared):
    samples = walk([(20.0, 0.0)])
    clean, _ = push_all(samples)
    pdr, _ = push_all(samples[:1200] + samples[1200 + lost :])
    assert pdr.faults == declared
    assert abs(pdr.pose().x_m - clean.pose().x_m) < 2.0
    if declared:
        assert pdr.pose().covariance[2, 2] > clean.pose().covariance[2, 2] + (0.01 * lost) ** 2


@pytest.mark.parametrize(("lost", "walks"), [(20, 1), (50, 1), (200, 2)])
def test_a_walk_goes_on_across_half_a_second_that_was_not_measured(lost, walks):
    samples = walk([(20.0, 0.0)])
    _, clean = push_all(samples)
    _, steps = push_all(samples[:1200] + samples[1200 + lost :])
    assert [s.interval_s for s in steps].count(None) == walks
    assert len(clean) - len(steps) <= math.ceil(0.018 * lost)


def test_at_half_the_rate_the_walk_is_as_long():
    samples = walk([(20.0, 0.0)])
    full, _ = push_all(samples, PedestrianDeadReckoning(PendulumStrideModel(1.75)))
    half, _ = push_all(samples[::2], PedestrianDeadReckoning(PendulumStrideModel(1.75)))
    assert half.step_count == full.step_count
    assert half.pose().x_m == pytest.approx(full.pose().x_m, rel=0.03)


def test_a_sensor_upside_down_makes_the_same_walk():
    legs = [(10.0, 0.0), (2.0, math.pi / 4), (10.0, 0.0)]
    upright, _ = push_all(walk(legs))
    over = quaternion.from_euler_zyx(math.pi, 0.0, 0.0)
    upside_down, _ = push_all(walk(legs, mounting=over))
    assert upside_down.step_count == upright.step_count
    assert upside_down.pose().x_m == pytest.approx(upright.pose().x_m, abs=0.05)
    assert upside_down.pose().y_m == pytest.approx(upright.pose().y_m, abs=0.05)


def test_a_clipped_turn_rate_makes_the_heading_less_sure_by_the_angle_it_may_hide():
    samples = walk([(20.0, 0.0)])
    clean, _ = push_all(samples)
    pdr, _ = push_all(broken(samples, "saturated"))
    assert pdr.faults["saturated"] == 29
    hidden_rad = 29 * 0.01 * 4.36
    assert pdr.pose().covariance[2, 2] >= clean.pose().covariance[2, 2] + 0.99 * hidden_rad**2


@settings(max_examples=30)
@given(
    st.lists(
        st.tuples(
            st.integers(-(10**9), 10**9),
            st.tuples(*[st.floats(allow_nan=True, allow_infinity=True)] * 3),
            st.tuples(*[st.floats(-2000, 2000)] * 3),
        ),
        max_size=40,
    )
)
def test_whatever_comes_the_pose_stays_finite_and_its_covariance_sound(items):
    pdr, _ = push_all(walk([(2.0, 0.0)]))
    stamp_ns = START_NS + 5 * NS_PER_S
    for dt_ns, rate, force in items:
        stamp_ns += dt_ns
        pdr.push(ImuSample(stamp_ns, rate, force))
    pose = pdr.pose()
    assert all(map(math.isfinite, (pose.x_m, pose.y_m, pose.yaw_rad)))
    assert np.linalg.eigvalsh(pose.covariance).min() > -1e-9 * np.trace(pose.covariance)


def ipol_trials(subjects):
    folder = Path(os.environ.get("MINE_LOC_DATA", "")) / "ipol_gait_lowerback" / "GaitData"
    if not folder.is_dir():
        pytest.skip("MINE_LOC_DATA names no folder with ipol_gait_lowerback")
    for path in sorted(folder.glob("*.json")):
        truth = json.loads(path.read_text())
        if truth["Subject"] in subjects:
            with gzip.open(path.with_name(path.stem + "_lb.txt.gz"), "rt") as file:
                yield truth, np.loadtxt(file, skiprows=2)


@pytest.mark.data
def test_real_walks_are_counted_within_five_percent_and_u_turns_read_as_180_degrees():
    """A guard against regressions on people 8 to 13 of ipol_gait_lowerback; bench/pdr.py scores people held out."""
    count_errors, turns_deg = [], []
    for truth, table in ipol_trials(range(8, 14)):
        samples = [
            ImuSample(START_NS + int(row[0]) * PERIOD_NS, tuple(map(float, row[4:7])), tuple(map(float, row[1:4])))
            for row in table
        ]
        pdr, steps = push_all(samples)
        true_count = len(truth["LeftFootEvents"]) + len(truth["RightFootEvents"])
        count_errors.append(abs(pdr.step_count - true_count) / true_count)
        (begin, end), (turn_begin, turn_end) = truth["TrialBoundaries"], truth["UTurnBoundaries"]
        at = [(s.stamp_ns - START_NS) / PERIOD_NS for s in steps]
        out = [np.exp(1j * s.heading_rad) for s, k in zip(steps, at, strict=True) if begin < k < turn_begin]
        back = [np.exp(1j * s.heading_rad) for s, k in zip(steps, at, strict=True) if turn_end < k < end]
        turns_deg.append(abs(np.degrees(np.angle(np.sum(back) / np.sum(out)))))
    assert len(count_errors) > 30
    assert np.mean(count_errors) < 0.05
    assert np.median(np.abs(np.array(turns_deg) - 180.0)) < 3.5
