from math import isnan, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_uwb.received_power import (
    Reception,
    Sfd,
    accumulated_symbols,
    first_path_power_dbm,
    los_probability_from_powers,
    powers_dbm,
    receive_power_dbm,
    reception_with_powers,
    uncompress_dbm,
)


def test_first_path_power_of_a_row_of_a_public_data_set():
    assert first_path_power_dbm((1404, 1657, 1179), 101, 64) == pytest.approx(-93.968, abs=5e-4)


def test_receive_power_of_a_reception_of_an_evaluation_kit():
    assert receive_power_dbm(10_854, 274, 64) == pytest.approx(-78.96, abs=5e-3)


def test_the_two_prfs_differ_by_their_constants():
    assert receive_power_dbm(10_854, 274, 16) - receive_power_dbm(10_854, 274, 64) == pytest.approx(121.74 - 113.77)


@pytest.mark.parametrize(
    ("sfd", "counted"),
    [
        (Sfd.UNKNOWN, 0),
        (Sfd.STANDARD_8, 5),
        (Sfd.STANDARD_64, 64),
        (Sfd.DECAWAVE_8, 10),
        (Sfd.DECAWAVE_16, 18),
        (Sfd.DECAWAVE_64, 82),
        (200, 0),
    ],
)
def test_symbols_of_the_sfd_are_taken_off_only_when_they_were_counted(sfd, counted):
    saturated = Reception(preamble_count=128, preamble_count_unsaturated=128, sfd=sfd)
    unsaturated = Reception(preamble_count=128, preamble_count_unsaturated=120, sfd=sfd)
    assert accumulated_symbols(saturated) == 128 - counted
    assert accumulated_symbols(unsaturated) == 128


@pytest.mark.parametrize(
    "reception",
    [
        Reception(),
        Reception(first_path_amplitude=(1, 1, 1), receive_power_counts=1, preamble_count=100, prf_mhz=63),
        Reception(first_path_amplitude=(1, 1, 1), receive_power_counts=1, preamble_count=0, prf_mhz=64),
        Reception(preamble_count=100, prf_mhz=64),
        Reception(0, (1, 1, 1), 0, 1, preamble_count=4, preamble_count_unsaturated=4, prf_mhz=64, sfd=Sfd.STANDARD_8),
    ],
)
def test_powers_are_nan_when_a_register_is_not_reported(reception):
    assert all(map(isnan, powers_dbm(reception)))


@pytest.mark.parametrize(("gap_db", "probability"), [(-1, 1), (6, 1), (7, 0.75), (8, 0.5), (10, 0), (30, 0)])
def test_line_of_sight_rule_is_linear_between_6_and_10_db(gap_db, probability):
    assert los_probability_from_powers(-85.0 - gap_db, -85.0) == pytest.approx(probability)


def test_line_of_sight_is_not_judged_without_powers():
    assert isnan(los_probability_from_powers(nan, -80.0))
    assert isnan(los_probability_from_powers(-80.0, nan))


def test_compression_is_undone_above_minus_88_dbm_only():
    assert uncompress_dbm(-90.0, 64) == -90.0
    assert uncompress_dbm(-80.0, 64) == pytest.approx(-80.0 + 8 * 1.1667)
    assert uncompress_dbm(-80.0, 16) == pytest.approx(-80.0 + 8 * 2.3334)


@given(st.floats(-92, -82), st.floats(-85, -80), st.integers(200, 700))
def test_simulated_registers_read_back_as_the_powers_they_stand_for(first_path, total, symbols):
    got_first_path, got_total = powers_dbm(reception_with_powers(first_path, total, symbols, 64))
    assert got_first_path == pytest.approx(first_path, abs=0.02)
    assert got_total == pytest.approx(total, abs=0.02)
