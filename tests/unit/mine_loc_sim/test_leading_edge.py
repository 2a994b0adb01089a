"""Leading-edge detection and registers: against real accumulators where they are at hand, against made ones always."""

import csv
import os
from pathlib import Path

import numpy as np
import pytest

from mine_loc_sim.channel_15_4a import FINE_PER_TAP
from mine_loc_sim.dw1000_accumulator import Receiver, Reception, accumulate, band_limit, reported_level_dbm, taps_to_m
from mine_loc_sim.leading_edge import first_path_index, noise_std, read_registers, threshold
from mine_loc_sim.radio_constants import SEARCH_START_TAP
from mine_loc_sim.range_bias import edge_lead_m, level_bias_m

COUNT = 200


def receive(taps, level_dbm, seed=0, **settings):
    rng = np.random.default_rng(seed)
    receiver = Receiver.draw(len(taps), rng)
    return accumulate(
        band_limit(taps), np.zeros(len(taps)), np.full(len(taps), float(level_dbm)), receiver, rng, **settings
    )


def lone_path(count=COUNT):
    taps = np.zeros((count, 4 * FINE_PER_TAP), np.complex64)
    taps[:, 0] = 1.0
    return taps


@pytest.fixture(scope="module")
def real_frames():
    if "MINE_LOC_DATA" not in os.environ:
        pytest.skip("MINE_LOC_DATA is not set: no real accumulators")
    folder = Path(os.environ["MINE_LOC_DATA"]) / "uwb_cirs_2018"
    with (folder / "frames.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))[::20]
    samples = np.load(folder / "cir_iq.npz")["cir"][::20].astype(np.float32)

    def column(name, base=None):
        return np.array([int(row[name], base) if base else float(row[name] or "nan") for row in rows])

    return samples.view(np.complex64)[..., 0] if samples.flags.c_contiguous else samples[..., 0] + 1j * samples[
        ..., 1
    ], column


@pytest.mark.data
def test_detection_finds_the_first_path_where_the_real_chip_does(real_frames):
    samples, column = real_frames
    error_taps = first_path_index(np.abs(samples), column("nth_hex", 16).astype(float)) - column("fp_idx")
    assert np.nanmedian(np.abs(error_taps)) < 0.1
    assert np.mean(np.abs(error_taps) < 0.5) > 0.9


@pytest.mark.data
def test_threshold_is_that_of_the_real_chip(real_frames):
    samples, column = real_frames
    ratio = threshold(noise_std(np.abs(samples)), column("psc").astype(int), 998) / column("nth_hex", 16)
    assert np.median(ratio) == pytest.approx(1.0, abs=0.05)
    assert np.all(np.abs(np.quantile(ratio, [0.1, 0.9]) - 1.0) < 0.25)


@pytest.mark.data
def test_registers_of_real_accumulators_give_the_logged_powers(real_frames):
    samples, column = real_frames
    symbols = column("psc").astype(int)
    registers = read_registers(Reception(samples, symbols, symbols < 998, column("fp_idx"), 998))
    same_path = np.abs(registers.first_path_index - column("fp_idx")) < 0.5
    assert np.median((registers.first_path_power_dbm - column("fsl_dbm"))[same_path]) == pytest.approx(0.0, abs=0.3)
    assert np.nanmedian(registers.receive_power_dbm - column("rsl_dbm")) == pytest.approx(0.0, abs=0.4)


@pytest.mark.parametrize("level_dbm", [-70.0, -85.0, -100.0])
def test_a_lone_path_is_found_within_centimetres_whatever_its_level(level_dbm):
    reception = receive(lone_path(), level_dbm)
    error_m = taps_to_m(read_registers(reception).first_path_index - reception.direct_index) + edge_lead_m()
    assert abs(error_m.mean()) < 0.01
    assert error_m.std() < 0.02


def test_below_the_noise_nothing_is_detected():
    registers = read_registers(receive(lone_path(), -125.0))
    assert not registers.detected.any()
    assert np.isnan(registers.first_path_index).all()
    assert np.all(registers.first_path_amplitude == 0)


def test_strong_receptions_stop_early_and_weak_ones_use_the_whole_preamble():
    strong, weak = receive(lone_path(), -70.0), receive(lone_path(), -100.0)
    assert strong.saturated.all()
    assert np.all(strong.symbols < 400)
    assert not weak.saturated.any()
    assert np.all(weak.symbols == 998)
    assert 16000 < np.median(np.abs(strong.samples).max(axis=1)) < 21000


def test_a_short_preamble_is_accumulated_101_times():
    assert np.all(receive(lone_path(), -100.0, full_count=101).symbols == 101)


def test_samples_are_whole_counts_of_16_bits():
    samples = receive(lone_path(20), -65.0).samples
    assert np.array_equal(samples, np.rint(samples.real) + 1j * np.rint(samples.imag))
    assert max(np.abs(samples.real).max(), np.abs(samples.imag).max()) < 2**15


def test_rxpacc_counts_the_sfd_only_where_nothing_saturated():
    strong, weak = (read_registers(receive(lone_path(20), level)) for level in (-70.0, -100.0))
    assert np.all(strong.rxpacc < strong.rxpacc_nosat)
    assert np.all(weak.rxpacc == weak.rxpacc_nosat)


def test_manual_power_formulas_on_known_registers():
    amplitude = np.array([1404, 1657, 1179])
    power = 10 * np.log10((amplitude.astype(float) ** 2).sum() / 101**2) - 121.74
    assert power == pytest.approx(-93.968, abs=1e-3)
    samples = np.zeros((1, 1016), np.complex64)
    samples[0, 745:750] = [0, 5000, 9000, 7000, 1000]
    samples[0, ::2] += 30
    registers = read_registers(Reception(samples, np.array([500]), np.array([False]), np.array([746.0]), 998))
    amplitudes = registers.first_path_amplitude[0].astype(float)
    expected = 10 * np.log10((amplitudes**2).sum() / 500**2) - 121.74
    assert registers.first_path_power_dbm[0] == pytest.approx(expected)


def test_reported_level_is_true_below_the_knee_compressed_above_and_has_a_ceiling():
    assert reported_level_dbm(np.array([-100.0, -88.0])) == pytest.approx([-100.0, -88.0])
    assert reported_level_dbm(np.array([-80.0]))[0] == pytest.approx(-88.0 + 8.0 / 2.1667)
    assert reported_level_dbm(np.array([-40.0]))[0] == pytest.approx(-78.3)


def test_range_bias_is_the_application_notes():
    assert level_bias_m(np.array([-80.0, -61.0, -50.0, -120.0])) == pytest.approx([0.028, -0.110, -0.110, 0.086])


def test_a_search_that_starts_inside_a_response_stays_where_it_starts():
    magnitude = (1000.0 + 0.01 * np.arange(1016, dtype=np.float32))[None]
    index = first_path_index(magnitude, np.array([300.0]))
    assert SEARCH_START_TAP - 1 <= index[0] <= SEARCH_START_TAP + 10
