"""Paper B's step detection: one step a peak and valley, none while standing, soon after the heel strike."""

import itertools
import math
import statistics

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import butter, sosfiltfilt

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S, to_ns
from mine_loc_pdr.steps import LONGEST_INTERVAL_NS, MovingMean, MovingMedian, PeakStepDetector, StepThresholds


def detect(values, rate_hz=100, detector=None, start_ns=10**18):
    """(stamp of the sample, step) of each step in `values` sampled at rate_hz."""
    detector = detector or PeakStepDetector()
    stamps = [start_ns + k * NS_PER_S // rate_hz for k in range(len(values))]
    return [
        (t, s)
        for t, v in zip(stamps, values, strict=True)
        for s in detector.push(t, (float(v), 0.0, 0.0, 0.0, 0.0, 0.0))
    ]


def walk(seconds, step_hz=1.8, rate_hz=100, amplitude=2.5):
    t = np.arange(round(seconds * rate_hz)) / rate_hz
    return amplitude * np.sin(2 * np.pi * step_hz * t)


@pytest.mark.parametrize("rate_hz", [50, 82, 100, 200, 400])
@pytest.mark.parametrize("step_hz", [1.0, 1.8, 2.8])
def test_every_cycle_is_one_step_at_any_sample_rate(step_hz, rate_hz):
    steps = detect(walk(20, step_hz, rate_hz), rate_hz)
    assert len(steps) == round(20 * step_hz)
    assert all(s.interval_s == pytest.approx(1 / step_hz, abs=0.03) for _, s in steps[3:])


def test_a_step_is_stamped_at_its_strike_after_the_rise_and_reported_within_four_tenths_of_a_second():
    steps = detect(walk(20, 1.8))
    for reported_ns, step in steps:
        phase = ((step.stamp_ns - 10**18) / NS_PER_S * 1.8) % 1.0
        assert phase == pytest.approx(0.065 * 1.8, abs=0.02)
        assert reported_ns - step.stamp_ns < 400 * NS_PER_MS


def test_a_slow_step_is_reported_before_its_valley_and_once():
    steps = detect(np.concatenate((walk(5, 1.6), walk(20, 1.0))))
    assert len(steps) == 28
    slow = [reported_ns - step.stamp_ns for reported_ns, step in steps if step.interval_s and step.interval_s > 0.9]
    assert len(slow) >= 18
    assert max(slow) < 500 * NS_PER_MS  # the valley of such a step begins after 590 ms


def test_standing_still_is_no_step():
    noise = np.random.default_rng(0).normal(0.0, 0.05, 60_000)
    assert detect(noise) == []


def test_swaying_and_shifting_the_weight_is_no_step():
    assert detect(walk(60, 0.5, amplitude=0.35)) == []
    assert detect(walk(60, 1.5, amplitude=0.8)) == []


def vibration(low_hz, high_hz, rms_m_s2, seconds=60):
    noise = np.random.default_rng(0).standard_normal(100 * seconds)
    band = sosfiltfilt(butter(2, [low_hz, high_hz], "bandpass", fs=100, output="sos"), noise)
    return band * rms_m_s2 / band.std()


@pytest.mark.parametrize(("low_hz", "high_hz", "rms_m_s2"), [(1, 4, 0.3), (2, 8, 0.3), (4, 20, 1.0)])
def test_a_ride_is_no_walk(low_hz, high_hz, rms_m_s2):
    """The vibration of a car's seat; a rough ride, 0.6 m/s² between 1 and 8 Hz, is taken for walking (docs/pdr.md)."""
    assert detect(vibration(low_hz, high_hz, rms_m_s2)) == []


@pytest.mark.parametrize("blows_hz", [0.8, 1.2, 2.0])
def test_hammering_is_no_walk(blows_hz):
    """Blows as the waist feels them: knocks of 6 m/s² for 30 ms, and the arm's swing."""
    t = np.arange(6000) / 100
    knocks = 6.0 * np.exp(-0.5 * ((((t * blows_hz) % 1.0 - 0.5) / blows_hz) / 0.012) ** 2)
    swing = 0.3 * np.sin(math.tau * blows_hz * t)
    assert detect(knocks - knocks.mean() + swing) == []


@pytest.mark.parametrize("seconds", [1.2, 1.6, 2.0])
@pytest.mark.parametrize("depth_m", [0.45, -0.45])
def test_sitting_down_and_standing_up_is_no_step(seconds, depth_m):
    s = np.arange(round(100 * seconds)) * 0.01 / seconds
    acceleration = -depth_m / seconds**2 * (60.0 * s - 180.0 * s**2 + 120.0 * s**3)  # of a smooth way down
    still = np.zeros(300)
    assert detect(np.concatenate((still, acceleration, still))) == []


def test_in_a_walk_weaker_peaks_count_than_at_its_start():
    steps = detect(np.concatenate((walk(4, 2.0), walk(4, 2.0, amplitude=0.7))))
    assert len(steps) == 16


def test_two_zero_crossings_between_peak_and_valley_are_no_step():
    valley = np.full(20, -2.0)
    up = np.concatenate((valley, -valley))
    wiggle = np.concatenate((np.full(30, -0.02), np.full(30, 0.02)))
    deep = StepThresholds(valley_m_s2=0.05)  # the valley that the wiggle does not reach
    assert len(detect(np.concatenate((up, valley)), detector=PeakStepDetector(deep))) == 1
    assert detect(np.concatenate((up, wiggle, valley)), detector=PeakStepDetector(deep)) == []


def test_the_first_step_after_standing_has_no_interval():
    still = np.zeros(to_ns(3.0) // (10 * NS_PER_MS))
    steps = [s for _, s in detect(np.concatenate((walk(3), still, walk(3))))]
    assert [s.interval_s is None for s in steps].count(True) == 2
    assert steps[0].interval_s is None


def test_shaking_faster_than_anyone_walks_is_not_a_step_a_shake():
    steps = [s for _, s in detect(walk(10, 5.0))]
    assert all(s.interval_s is None or s.interval_s >= 0.3 for s in steps)
    assert len(steps) <= 10 / 0.3


def test_an_accelerometer_offset_goes_away():
    assert len(detect(walk(60, 1.8, amplitude=1.2) + 1.0)) == pytest.approx(108, abs=8)


def test_one_weak_peak_after_a_walk_is_the_foot_drawn_up_a_second_is_none():
    sway = walk(0.56, 1.8, amplitude=0.2)
    still = np.zeros(100)
    halt = [s for _, s in detect(np.concatenate((walk(4, 2.0), sway, still)))]
    assert len(halt) == 9
    swaying = [s for _, s in detect(np.concatenate((walk(4, 2.0), sway, sway, sway, sway, still)))]
    assert len(swaying) == 9


def test_thresholds_follow_the_person():
    for strong in (1.5, 6.0):
        steps = detect(np.concatenate((walk(4, 2.0, amplitude=strong), walk(4, 2.0, amplitude=0.5 * strong))))
        assert len(steps) == 16
    shuffling = detect(np.concatenate((walk(4, 2.0, amplitude=6.0), walk(6, 2.0, amplitude=0.5), np.zeros(100))))
    assert len(shuffling) <= 10


def test_a_long_lift_is_no_step():
    assert detect(np.concatenate((np.zeros(100), np.full(80, 2.0), np.full(80, -2.0), np.zeros(100)))) == []


def test_reset_forgets_the_walk():
    detector = PeakStepDetector()
    detect(walk(3), detector=detector)
    detector.reset()
    assert detect(walk(3), detector=detector, start_ns=2 * 10**18)[0][1].interval_s is None


def test_confidence_is_a_probability_that_grows_with_the_peak():
    weak, strong = (detect(walk(10, amplitude=amplitude))[-1][1] for amplitude in (1.3, 4.0))
    assert 0.5 < weak.confidence < strong.confidence < 1.0


@given(st.lists(st.floats(-50, 50), min_size=1, max_size=200), st.integers(2, 30))
def test_the_moving_median_is_the_median_of_the_window(values, window):
    median = MovingMedian(window * 10)
    for k, value in enumerate(values):
        middle_ns, result = median.push(k * 10, value)
        inside = values[max(0, k - window + 1) : k + 1]
        assert result == statistics.median_high(inside)
        assert middle_ns == (max(0, k - window + 1) * 10 + k * 10) // 2


@given(st.lists(st.floats(-50, 50), min_size=1, max_size=200), st.integers(2, 30))
def test_the_moving_mean_is_the_mean_of_the_window(values, window):
    mean = MovingMean(window * 10)
    for k, value in enumerate(values):
        middle_ns, result = mean.push(k * 10, value)
        inside = values[max(0, k - window + 1) : k + 1]
        assert result == pytest.approx(statistics.fmean(inside), abs=1e-9)
        assert middle_ns == (max(0, k - window + 1) * 10 + k * 10) // 2


@given(st.lists(st.floats(-500, 500), max_size=400))
def test_steps_of_any_signal_are_in_order_and_apart(values):
    steps = [s for _, s in detect(values)]
    for earlier, later in itertools.pairwise(steps):
        apart_ns = later.stamp_ns - earlier.stamp_ns
        assert apart_ns >= 300 * NS_PER_MS
        assert (later.interval_s is None) == (apart_ns > LONGEST_INTERVAL_NS)
        assert math.isfinite(later.confidence)
