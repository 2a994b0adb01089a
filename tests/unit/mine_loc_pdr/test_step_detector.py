"""Steps by the shipped network: simulated people, slow ones too, are followed; rides and tools make no steps."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_core.stamps import NS_PER_S, to_ns
from mine_loc_pdr.attitude import Vector3
from mine_loc_pdr.dead_reckoning import ImuSample, PedestrianDeadReckoning
from mine_loc_pdr.shaking import band_noise, sitting_down
from mine_loc_pdr.step_detector import LOOKAHEAD_S, SHORTEST_INTERVAL_NS, NetworkStepDetector, StepModel
from mine_loc_pdr.step_frames import CHANNELS, FRAME_NS
from mine_loc_pdr.step_model_file import load_step_model, shipped_step_model
from mine_loc_pdr.steps import LONGEST_INTERVAL_NS
from mine_loc_pdr.stride import PendulumStrideModel
from mine_loc_sim.gait import draw_person
from mine_loc_sim.imu_errors import FLU_TO_FRD, Imu, draw_device
from mine_loc_sim.route import WayPoint, plan_route
from mine_loc_sim.walker import Walker

START_NS = NS_PER_S
MODEL = load_step_model(shipped_step_model())[0]


def detect(motion, period_ns=FRAME_NS, detector=None, start_ns=10**18):
    """(stamp of the sample, step) of each step in motion (n, CHANNELS)."""
    detector = detector or NetworkStepDetector(MODEL)
    stamps = range(start_ns, start_ns + len(motion) * period_ns, period_ns)
    rows = zip(stamps, motion.tolist(), strict=True)
    return [(t, step) for t, row in rows for step in detector.push(t, tuple(map(float, row)))]


def pelvis(seconds, step_hz=1.8, rate_hz=50):
    """Bounce and push once a step, sway and roll once a stride."""
    phase = math.tau * step_hz * np.arange(round(seconds * rate_hz)) / rate_hz
    motion = np.zeros((len(phase), CHANNELS))
    motion[:, 0], motion[:, 1] = 2.5 * np.sin(phase), np.sin(phase - 1.9)
    motion[:, 2], motion[:, 4] = 1.2 * np.sin(0.5 * phase), 0.4 * np.cos(0.5 * phase)
    return motion


def samples(person, seed):
    """Of a simulated device on 30 m with a turn, and the true strikes."""
    rng = np.random.default_rng(seed)
    corners = [
        WayPoint((0.0, 0.0, 0.0), pause_s=4.0),
        WayPoint((15.0, 0.0, 0.0)),
        WayPoint((15.0, 15.0, 0.0), pause_s=4.0),
    ]
    walker = Walker(person, plan_route(corners, person.preferred_speed_m_s), rng, START_NS)
    imu = Imu(draw_device(rng), 100.0, rng)
    stamps_ns = imu.stamps_ns(START_NS, START_NS + to_ns(walker.duration_s))
    sensed = imu.sample(walker.motion(stamps_ns), np.zeros((len(stamps_ns), 3)))
    rates, forces = (each.astype(float) * FLU_TO_FRD for each in (sensed.gyro_rad_s, sensed.accel_m_s2))
    rows = zip(stamps_ns.tolist(), rates.tolist(), forces.tolist(), strict=True)
    return [ImuSample(t, tuple(w), tuple(f)) for t, w, f in rows], [step.stamp_ns for step in walker.steps()]


@pytest.mark.parametrize("speed_m_s", [0.6, 0.9, 1.4])
@pytest.mark.parametrize("forward_imu", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
def test_simulated_people_are_followed_slow_ones_too_however_the_front_is_stated(
    speed_m_s: float, forward_imu: Vector3
):
    found = true = 0
    for seed in range(3):
        person = draw_person(np.random.default_rng(100 + seed), preferred_speed_m_s=speed_m_s)
        sent, strikes_ns = samples(person, seed)
        pdr = PedestrianDeadReckoning(PendulumStrideModel(1.75), forward_imu, NetworkStepDetector(MODEL))
        found += sum(len(pdr.push(sample)) for sample in sent)
        true += len(strikes_ns)
    assert 0.9 * true <= found <= 1.02 * true


@pytest.mark.parametrize("step_hz", [1.4, 1.8, 2.2])
def test_every_step_is_reported_within_four_tenths_of_a_second_of_its_stamp(step_hz):
    steps = detect(pelvis(20, step_hz))
    assert 20 * step_hz - 2.5 < len(steps) < 20 * step_hz + 1.5  # a walk out of nothing: its first two are in doubt
    late_ns = [reported_ns - step.stamp_ns for reported_ns, step in steps]
    assert max(late_ns[1:]) < 0.4 * NS_PER_S
    assert late_ns[0] < 1.4 * NS_PER_S  # told with the second where it was in doubt
    assert all(step.interval_s == pytest.approx(1 / step_hz, abs=0.06) for _, step in steps[3:])


@pytest.mark.parametrize("rate_hz", [25, 100, 400])
def test_the_rate_of_the_samples_changes_nothing(rate_hz):
    stamps = [[step.stamp_ns for _, step in detect(pelvis(20, 1.8, hz), NS_PER_S // hz)] for hz in (rate_hz, 1000)]
    assert len(stamps[0]) == len(stamps[1])
    np.testing.assert_allclose(stamps[0][3:], stamps[1][3:], atol=0.03 * NS_PER_S)


def test_the_first_step_after_standing_has_no_interval():
    steps = [s for _, s in detect(np.concatenate((pelvis(5), np.zeros((200, CHANNELS)), pelvis(5))))]
    assert [s.interval_s is None for s in steps].count(True) == 2
    assert steps[0].interval_s is None


class Told:
    """A network that says the probability it is told for an instant (s from the first frame), else next to none."""

    def __init__(self, probabilities):
        self._logits = {round(t / 0.02): math.log(p / (1 - p)) for t, p in probabilities.items()}
        self._frame = 0

    def push(self, _):
        self._frame += 1
        return self._logits.get(self._frame, -20.0)


def told(probabilities):
    """Instants (s) at which the told maxima became steps."""
    detector = NetworkStepDetector(StepModel(MODEL.weights, 0.25))
    detector._stream = Told(probabilities)
    stamps_s = [
        step.stamp_ns / NS_PER_S for _, step in detect(np.zeros((400, CHANNELS)), detector=detector, start_ns=0)
    ]
    return [round(s + LOOKAHEAD_S + 0.02, 2) for s in stamps_s]


WALK = {1.0 + 0.6 * k: 0.9 for k in range(5)}  # the last at 3.4 s


@pytest.mark.parametrize(
    ("after_s", "probability", "is_step"),
    [(0.6, 0.3, True), (0.9, 0.3, True), (0.3, 0.8, False), (0.3, 0.95, True), (2.0, 0.5, False), (2.0, 0.65, True)],
)
def test_the_rhythm_says_how_likely_a_step_must_be(after_s, probability, is_step):
    found = told(WALK | {3.4 + after_s: probability})
    assert found[:5] == pytest.approx(list(WALK), abs=0.021)
    assert len(found) == 5 + is_step


@pytest.mark.parametrize(
    ("first", "after_s", "second", "found"),
    [
        (0.5, 0.6, 0.8, [1.0, 1.6]),  # borne out
        (0.5, 0.6, 0.55, []),  # both in doubt
        (0.2, 0.6, 0.95, [1.6]),  # no step of any walk
        (0.5, 0.3, 0.8, [1.3]),  # too early
        (0.5, 1.2, 0.8, [2.2]),  # too late
        (0.65, 0.6, 0.5, [1.0, 1.6]),  # not in doubt
    ],
)
def test_a_first_step_in_doubt_is_told_when_the_second_bears_it_out(first, after_s, second, found):
    assert told({1.0: first, 1.0 + after_s: second}) == pytest.approx(found, abs=0.021)


def test_of_two_maxima_in_doubt_close_together_the_likelier_waits():
    assert told({1.0: 0.55, 1.1: 0.3, 1.6: 0.8}) == pytest.approx([1.0, 1.6], abs=0.021)
    assert told({1.0: 0.3, 1.1: 0.55, 1.7: 0.8}) == pytest.approx([1.1, 1.7], abs=0.021)


def test_a_first_step_told_late_keeps_its_stamp_and_the_next_has_the_interval():
    motion = np.concatenate((np.zeros((40, CHANNELS)), pelvis(1.2), np.zeros((100, CHANNELS))))
    detector = NetworkStepDetector(StepModel(MODEL.weights, 0.25))
    detector._stream = Told({1.4: 0.5, 2.0: 0.8})
    (first_ns, first), (second_ns, second) = detect(motion, detector=detector)
    assert first_ns == second_ns
    assert second.stamp_ns - first.stamp_ns == pytest.approx(0.6 * NS_PER_S, abs=1)
    assert (first.interval_s, second.interval_s) == (None, pytest.approx(0.6))


def test_a_pause_between_two_steps_does_not_make_the_next_one_early():
    assert len(told(WALK | {4.8: 0.9, 5.4: 0.5})) == 7


def test_reset_forgets_the_walk():
    detector = NetworkStepDetector(MODEL)
    detect(pelvis(5), detector=detector)
    detector.reset()
    assert detect(pelvis(5), detector=detector, start_ns=2 * 10**18)[0][1].interval_s is None


@pytest.mark.parametrize("rms_m_s2", [0.6, 1.0, 1.5])
@pytest.mark.parametrize(("low_hz", "high_hz"), [(1, 8), (2, 8), (4, 20)])
def test_a_rough_ride_is_no_walk(low_hz, high_hz, rms_m_s2):
    """A minute on a seat that shakes, rocks and turns: three false steps at most (docs/pdr.md: other bands)."""
    rng = np.random.default_rng(7)
    gains = (rms_m_s2, 0.5 * rms_m_s2, 0.5 * rms_m_s2, 0.05, 0.05, 0.05)
    motion = np.column_stack([gain * band_noise(rng, 3000, low_hz, high_hz) for gain in gains])
    assert len(detect(motion)) <= 3


@pytest.mark.parametrize("blow_m_s2", [6.0, 10.0, 15.0])
@pytest.mark.parametrize("blows_hz", [0.8, 1.2, 2.0])
def test_hammering_is_no_walk(blows_hz, blow_m_s2):
    """Blows as the waist feels them: knocks of 30 ms, and the arm's swing."""
    t = np.arange(6000) / 100
    knocks = blow_m_s2 * np.exp(-0.5 * ((((t * blows_hz) % 1.0 - 0.5) / blows_hz) / 0.012) ** 2)
    motion = np.zeros((len(t), CHANNELS))
    motion[:, 0] = knocks - knocks.mean() + 0.3 * np.sin(math.tau * blows_hz * t)
    motion[:, 4] = 0.01 * knocks
    assert detect(motion, NS_PER_S // 100) == []


def test_standing_and_sitting_down_is_no_step():
    rng = np.random.default_rng(3)
    still = 0.03 * rng.standard_normal((3000, CHANNELS))
    assert detect(still) == []
    assert sum(len(detect(sitting_down(rng, 300))) for _ in range(20)) <= 1


@settings(max_examples=25)
@given(st.integers(0, 2**32), st.floats(0.1, 500.0))
def test_steps_of_any_motion_are_in_order_and_apart(seed, scale):
    motion = scale * np.random.default_rng(seed).standard_normal((400, CHANNELS))
    steps = [s for _, s in detect(motion)]
    for earlier, later in itertools.pairwise(steps):
        apart_ns = later.stamp_ns - earlier.stamp_ns
        assert apart_ns >= SHORTEST_INTERVAL_NS
        assert (later.interval_s is None) == (apart_ns > LONGEST_INTERVAL_NS)
        assert 0.0 < later.confidence <= 1.0
