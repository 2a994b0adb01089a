import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mine_loc_sim import gait_constants as gc
from mine_loc_sim.gait import IrregularMotion, StepLaw, control_instants_s, draw_person, periodic_motion

law_of = st.builds(StepLaw, st.floats(1.5, 2.0), st.just(gc.ALPHA), st.just(gc.BETA), st.floats(0.75, 1.25))


def test_the_law_gives_paper_bs_length_at_its_reference():
    law = StepLaw(height_m=1.75, alpha=0.371, beta=0.227, stride_factor=1.0)
    assert float(law.length_m(np.array(1.79))) == pytest.approx(0.7)
    assert float(law.length_m(np.array(2.0))) == pytest.approx(0.7 + 0.227 * 0.21)


@given(law_of, st.floats(0.7, 2.5))
def test_cadence_times_step_length_is_the_speed(law, speed):
    frequency = law.frequency_hz(np.array(speed))
    assume(float(frequency) > gc.MIN_STEP_FREQUENCY_HZ)
    assert float(frequency * law.length_m(frequency)) == pytest.approx(speed, rel=1e-9)


@given(law_of)
def test_cadence_never_falls_with_speed_nor_below_the_slowest_walk(law):
    frequency = law.frequency_hz(np.linspace(0.0, 2.5, 60))
    assert np.all(np.diff(frequency) >= 0)
    assert frequency[0] == gc.MIN_STEP_FREQUENCY_HZ


def test_the_same_seed_draws_the_same_person_and_another_seed_another():
    first, again, other = (draw_person(np.random.default_rng(seed)) for seed in (7, 7, 8))
    np.testing.assert_array_equal(first.harmonics, again.harmonics)
    assert first.law == again.law
    assert not np.array_equal(first.harmonics, other.harmonics)
    assert first.law != other.law


def test_what_is_given_of_a_person_is_kept():
    person = draw_person(np.random.default_rng(1), height_m=1.62, stride_factor=1.1, preferred_speed_m_s=0.9)
    assert (person.height_m, person.law.height_m, person.law.stride_factor, person.preferred_speed_m_s) == (
        1.62,
        1.62,
        1.1,
        0.9,
    )


def test_people_have_the_measured_mean_and_spread():
    people = [draw_person(np.random.default_rng(seed)) for seed in range(400)]
    speed = np.array([p.preferred_speed_m_s for p in people])
    factor = np.array([p.law.stride_factor for p in people])
    assert speed.mean() == pytest.approx(gc.PREFERRED_SPEED_M_S, abs=0.04)
    assert speed.std() == pytest.approx(gc.PREFERRED_SPEED_SD_M_S, rel=0.15)
    assert np.polyfit(speed, factor, 1)[0] == pytest.approx(gc.STRIDE_FACTOR_PER_SPEED, abs=0.06)


def phase_and_gain(t):
    phase = (11 * t + 0.1 * np.sin(3 * t), 11 + 0.3 * np.cos(3 * t), -0.9 * np.sin(3 * t))
    scale = np.linspace(0.5, 1.5, 6)
    gain = tuple(
        np.multiply.outer(g, scale) for g in (1 + 0.3 * np.sin(2 * t), 0.6 * np.cos(2 * t), -1.2 * np.sin(2 * t))
    )
    return phase, gain


def test_rates_and_accelerations_of_the_gait_are_derivatives_of_its_motion():
    person = draw_person(np.random.default_rng(3))
    t = np.arange(0.0, 3.0, 1e-4)
    sway = periodic_motion(person.harmonics, *phase_and_gain(t))
    for value, rate in ((sway.value, sway.rate), (sway.rate, sway.acceleration)):
        difference = np.diff(value, axis=0) / 1e-4
        np.testing.assert_allclose(difference, (rate[1:] + rate[:-1]) / 2, atol=1e-4 * np.abs(rate).max())


def test_without_asymmetry_a_right_step_mirrors_a_left_one():
    harmonics = draw_person(np.random.default_rng(4)).harmonics.copy()
    k = np.arange(1, len(harmonics) + 1)
    mirrors = np.array([c.mirrors for c in gc.CHANNELS])
    harmonics[(k[:, None] % 2 == 1) != mirrors] = 0.0
    phase = np.linspace(0, np.pi, 50)
    ones, zeros = np.ones((50, 6)), np.zeros((50, 6))

    def at(angle):
        return periodic_motion(harmonics, (angle, np.ones(50), np.zeros(50)), (ones, zeros, zeros)).value

    np.testing.assert_allclose(at(phase + np.pi), np.where(mirrors, -1.0, 1.0) * at(phase), atol=1e-12)


def test_a_drawn_person_limps_a_little():
    series = draw_person(np.random.default_rng(5)).harmonics
    k = np.arange(1, len(series) + 1)
    limp, regular = np.abs(series[k % 2 == 1, 2]).max(), np.abs(series[k % 2 == 0, 2]).max()
    assert 0.0 < limp < 0.6 * regular


def test_irregular_motion_has_the_stated_deviation_and_rests_where_nothing_moves():
    instants = control_instants_s(7.0, 400.0)
    deviation = np.array([0.5, 0.4, 0.3, 0.1, 0.2, 0.15])
    motion = IrregularMotion(np.random.default_rng(6), 7.0, np.outer(instants < 200.0, deviation))
    moving, still = (motion.at(np.arange(a, a + 190.0, 0.01)) for a in (5.0, 205.0))
    measured = np.r_[moving.acceleration.std(axis=0)[:3], moving.rate.std(axis=0)[3:]]
    np.testing.assert_allclose(measured, deviation, rtol=0.05)
    assert np.all(still.acceleration == 0.0)
    assert np.all(still.value == 0.0)
