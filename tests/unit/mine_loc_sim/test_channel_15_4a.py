"""CM7 and CM8 against the reference statistics of an independent Monte Carlo run with the final report's parameters."""

import numpy as np
import pytest

from mine_loc_sim.channel_15_4a import (
    BIN_NS,
    FINE_PER_TAP,
    TAP_NS,
    delay_statistics,
    draw_responses,
    fade,
    path_loss_db,
    power_delay_profile,
    without_clusters,
)
from mine_loc_sim.radio_constants import CM4, CM7, CM8

DRAWS = 1000


@pytest.fixture(scope="module")
def cm7():
    return draw_responses(CM7, DRAWS, np.random.default_rng(7))


@pytest.fixture(scope="module")
def cm8():
    return draw_responses(CM8, DRAWS, np.random.default_rng(8))


def test_cm7_delay_spread_is_that_of_the_final_report_and_not_of_the_draft(cm7):
    mean_ns, rms_ns = delay_statistics(cm7, BIN_NS)
    assert 17.0 <= rms_ns.mean() <= 19.5  # the draft's decay constants give 1 to 1.6 ns
    assert mean_ns.mean() == pytest.approx(11.4, abs=1.5)


def test_cm7_at_the_accumulator_tap_keeps_its_delay_spread_and_the_first_taps_share(cm7):
    energy = np.abs(cm7[:, : cm7.shape[1] // FINE_PER_TAP * FINE_PER_TAP]) ** 2
    on_taps = np.sqrt(energy.reshape(DRAWS, -1, FINE_PER_TAP).sum(axis=2)).astype(np.complex64)
    _, rms_ns = delay_statistics(on_taps, TAP_NS)
    assert 16.5 <= rms_ns.mean() <= 19.5
    assert 10.0 * np.log10((np.abs(on_taps[:, 0]) ** 2).mean()) == pytest.approx(-2.6, abs=1.0)


def test_cm8_is_one_cluster_with_a_slow_onset(cm8):
    mean_ns, rms_ns = delay_statistics(cm8, BIN_NS)
    assert rms_ns.mean() == pytest.approx(87.0, rel=0.05)  # the draft gives 20 ns
    assert mean_ns.mean() == pytest.approx(99.8, rel=0.05)
    assert np.median(np.abs(cm8).argmax(axis=1)) * BIN_NS == pytest.approx(37.7, abs=6.0)
    assert np.all(cm8[:, 0] == 0.0)


def test_cm8_mean_power_peaks_9_metres_after_the_direct_path():
    power, _ = power_delay_profile(CM8, 1, np.random.default_rng(0))
    assert power[0].argmax() * BIN_NS == pytest.approx(30.85, abs=BIN_NS)


@pytest.mark.parametrize("parameters", [CM4, CM7, CM8, without_clusters(CM7)])
def test_responses_have_unit_energy_and_repeat_with_the_seed(parameters):
    taps = draw_responses(parameters, 5, np.random.default_rng(3))
    np.testing.assert_allclose((np.abs(taps) ** 2).sum(axis=1), 1.0, rtol=1e-5)
    assert np.array_equal(taps, draw_responses(parameters, 5, np.random.default_rng(3)))


def test_without_clusters_the_energy_is_in_the_first_nanoseconds():
    _, rms_ns = delay_statistics(draw_responses(without_clusters(CM7), 200, np.random.default_rng(1)), BIN_NS)
    assert rms_ns.max() < 3.0


def test_fading_has_the_nakagami_mean_and_spread():
    m = np.full(200_000, 4.0, np.float32)
    energy = np.abs(fade(np.full_like(m, 2.0), m, np.random.default_rng(2))) ** 2
    assert energy.mean() == pytest.approx(2.0, rel=0.02)
    assert energy.std() == pytest.approx(2.0 / np.sqrt(4.0), rel=0.02)


@pytest.mark.parametrize(
    ("parameters", "expected_dbm"),
    [(CM7, [-71.0, -79.4, -83.0, -88.7, -91.4]), (CM8, [-71.0, -86.0, -92.5, -102.8, -107.5])],
)
def test_link_budget_at_the_legal_transmit_power(parameters, expected_dbm):
    distance_m = np.array([1.0, 5.0, 10.0, 30.0, 50.0])
    tolerance_db = 0.35  # the reference column rounds the distance law
    np.testing.assert_allclose(-14.3 - path_loss_db(parameters, distance_m), expected_dbm, atol=tolerance_db)
