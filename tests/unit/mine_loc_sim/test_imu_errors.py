import dataclasses
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_S
from mine_loc_sim import imu_constants as ic
from mine_loc_sim.gait_constants import GRAVITY_M_S2
from mine_loc_sim.imu_errors import Imu, Triad, draw_device, ideal_device
from mine_loc_sim.magnetic_field import GalleryField
from mine_loc_sim.waist_motion import WaistMotion

NORTH_5_UT = np.array([[0.0, 5e-6, 0.0]])


def resting(count, heading_rad=0.0, rate=(0.0, 0.0, 0.0), force=(0.0, 0.0, GRAVITY_M_S2)):
    zeros = np.zeros((count, 3))
    attitude = np.tile([math.cos(heading_rad / 2), 0.0, 0.0, math.sin(heading_rad / 2)], (count, 1))
    return WaistMotion(
        np.arange(count) * 10_000_000,
        zeros,
        zeros,
        zeros,
        attitude,
        np.full(count, heading_rad),
        np.tile(rate, (count, 1)),
        np.tile(force, (count, 1)),
    )


def field(count):
    return np.tile(NORTH_5_UT, (count, 1))


def imu(errors, rate_hz=100.0, seed=0):
    return Imu(errors, rate_hz, np.random.default_rng(seed))


def test_an_ideal_device_at_rest_reads_gravity_upwards_in_forward_right_down_axes():
    sample = imu(ideal_device()).sample(resting(1, heading_rad=math.pi / 2), field(1))
    np.testing.assert_allclose(sample.accel_m_s2, [[0, 0, -GRAVITY_M_S2]], atol=1e-6)
    np.testing.assert_allclose(sample.gyro_rad_s, 0.0)
    np.testing.assert_allclose(sample.mag_mg, [[50.0, 0.0, 0.0]], atol=1e-4)


def test_left_and_up_change_sign_on_the_way_to_right_and_down():
    sample = imu(ideal_device()).sample(resting(1, rate=(0.1, 0.2, 0.3), force=(1.0, 2.0, 9.0)), field(1))
    np.testing.assert_allclose(sample.gyro_rad_s, [[0.1, -0.2, -0.3]], rtol=1e-6)
    np.testing.assert_allclose(sample.accel_m_s2, [[1.0, -2.0, -9.0]], rtol=1e-6)
    np.testing.assert_allclose(sample.mag_mg, [[0.0, -50.0, 0.0]], atol=1e-4)


def test_a_crooked_mounting_turns_all_three_sensors_together():
    tilted = dataclasses.replace(ideal_device(), mounting=Rotation.from_euler("x", 30, degrees=True))
    sample = imu(tilted).sample(resting(1), field(1))
    half, tall = GRAVITY_M_S2 * math.sin(math.radians(30)), GRAVITY_M_S2 * math.cos(math.radians(30))
    np.testing.assert_allclose(sample.accel_m_s2, [[0, half, -tall]], atol=1e-5)
    np.testing.assert_allclose(
        sample.mag_mg, [[0, -50 * math.cos(math.radians(30)), -50 * math.sin(math.radians(30))]], atol=1e-4
    )


def test_noise_at_rest_has_the_density_of_the_class_at_any_rate():
    for rate_hz in (50.0, 400.0):
        errors = draw_device(np.random.default_rng(1))
        sample = imu(errors, rate_hz).sample(resting(20_000), field(20_000))
        for values, triad in ((sample.gyro_rad_s, errors.gyro), (sample.accel_m_s2, errors.accel)):
            difference = np.diff(values.astype(float), axis=0).std(axis=0) / math.sqrt(2)
            np.testing.assert_allclose(difference, triad.noise_density * math.sqrt(rate_hz / 2), rtol=0.03)


def test_devices_are_drawn_within_the_figures_of_the_class():
    for seed in range(50):
        errors = draw_device(np.random.default_rng(seed))
        for triad, spec in ((errors.gyro, ic.GYRO), (errors.accel, ic.ACCEL), (errors.mag, ic.MAG)):
            assert spec.noise_density[0] <= triad.noise_density <= spec.noise_density[1]
            assert spec.instability[0] <= triad.instability <= spec.instability[1]
            assert np.all(np.abs(triad.turn_on_bias) >= spec.turn_on_bias[0])
            assert np.all(np.abs(triad.turn_on_bias) <= spec.turn_on_bias[1])


def test_the_mean_at_rest_is_the_turn_on_bias_and_drifts_as_the_chip_warms():
    errors = draw_device(np.random.default_rng(2))
    device = imu(errors)
    cold = device.sample(resting(200), field(200))
    for _ in range(20):
        warm = device.sample(resting(10_000), field(10_000))
    density = errors.gyro.noise_density * math.sqrt(50 / 200)
    cold_mean, warm_mean = cold.gyro_rad_s.mean(axis=0), warm.gyro_rad_s.mean(axis=0)
    np.testing.assert_allclose(cold_mean, errors.gyro.turn_on_bias, atol=5 * density + 4 * errors.gyro.instability)
    warmed = errors.gyro.turn_on_bias + ic.SELF_HEATING_K * errors.gyro.bias_per_kelvin
    np.testing.assert_allclose(warm_mean, warmed, atol=5 * density + 4 * errors.gyro.instability)
    assert cold.temperature_c[0] == pytest.approx(ic.AMBIENT_C)
    assert warm.temperature_c[-1] == pytest.approx(ic.AMBIENT_C + ic.SELF_HEATING_K, abs=0.2)


def test_the_slow_bias_has_the_stated_instability():
    quiet = Triad(np.eye(3), np.zeros(3), np.zeros(3), 0.0, 1e-3, math.inf)
    device = imu(dataclasses.replace(ideal_device(), gyro=quiet), rate_hz=50.0)
    bias = np.concatenate([device.sample(resting(50_000), field(50_000)).gyro_rad_s[::50] for _ in range(20)])
    assert bias.std() == pytest.approx(1e-3, rel=0.25)
    assert np.abs(np.diff(bias, axis=0)).max() < 1e-3


def test_scale_and_misalignment_act_on_the_true_rate():
    gyro = Triad(np.array([[1.01, 0.002, 0], [0, 1, 0], [0, 0, 0.98]]), np.zeros(3), np.zeros(3), 0.0, 0.0, math.inf)
    sample = imu(dataclasses.replace(ideal_device(), gyro=gyro)).sample(resting(1, rate=(1.0, -2.0, -3.0)), field(1))
    np.testing.assert_allclose(sample.gyro_rad_s, [[1.01 + 0.004, 2.0, 2.94]], rtol=1e-6)


def test_what_exceeds_the_range_saturates():
    limited = dataclasses.replace(ideal_device().accel, limit=16_000 * ic.MG)
    blow = resting(1, force=(500.0, 0.0, -500.0))
    sample = imu(dataclasses.replace(ideal_device(), accel=limited)).sample(blow, field(1))
    np.testing.assert_allclose(sample.accel_m_s2, [[16_000 * ic.MG, 0.0, 16_000 * ic.MG]], rtol=1e-6)


def test_the_same_seed_gives_the_same_samples_in_blocks_of_any_size_as_float32():
    errors = draw_device(np.random.default_rng(3))
    whole = imu(errors, seed=4).sample(resting(1000), field(1000))
    device = imu(errors, seed=4)
    pieces = [device.sample(resting(n), field(n)) for n in (1, 399, 600)]
    for name in ("gyro_rad_s", "accel_m_s2", "mag_mg", "temperature_c"):
        assert getattr(whole, name).dtype == np.float32
        np.testing.assert_array_equal(getattr(whole, name), np.concatenate([getattr(p, name) for p in pieces]))
    other = imu(errors, seed=5).sample(resting(1000), field(1000))
    assert not np.array_equal(whole.gyro_rad_s, other.gyro_rad_s)


@pytest.mark.parametrize("rate_hz", [50.0, 100.0, 333.0, 400.0])
def test_sampling_instants_do_not_drift_over_a_shift(rate_hz):
    start = 1_700_000_000_000_000_000
    at = imu(ideal_device(), rate_hz).stamps_ns(start, start + 3600 * NS_PER_S)
    assert len(at) == round(3600 * rate_hz)
    assert abs(int(at[-1]) - start - round((len(at) - 1) * NS_PER_S / rate_hz)) <= 1
    assert np.ptp(np.diff(at)) <= 1


@pytest.mark.parametrize("rate_hz", [0.0, 49.9, 401.0, math.nan])
def test_a_rate_the_device_has_not_is_refused(rate_hz):
    with pytest.raises(ConfigurationError, match="rate_hz"):
        imu(ideal_device(), rate_hz)


def test_steel_bends_the_field_from_place_to_place_up_to_what_was_captured_and_the_same_each_time():
    earth = np.linalg.norm(ic.EARTH_FIELD_T)
    along = np.column_stack([np.arange(0, 2000, 0.25), np.zeros(8000), np.ones(8000)])
    here, again = (GalleryField(np.random.default_rng(1)).at(along) for _ in range(2))
    np.testing.assert_array_equal(here, again)
    strength = np.linalg.norm(here, axis=1) / earth
    assert strength.max() <= ic.FIELD_LIMIT_SHARE + 1e-9
    assert strength.max() > 2.0
    heading = np.unwrap(np.arctan2(here[:, 1], here[:, 0]))
    assert np.degrees(np.std(heading)) > 20.0
    assert np.abs(np.diff(here, axis=0)).max() < 0.6 * earth


def test_without_steel_the_field_is_earths():
    places = np.random.default_rng(0).uniform(-50, 50, (20, 3))
    np.testing.assert_allclose(
        GalleryField(np.random.default_rng(1), steel_share=0.0).at(places), np.tile(ic.EARTH_FIELD_T, (20, 1))
    )
