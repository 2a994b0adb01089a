import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.power_bias import NO_POWER_BIAS, PowerBias, aps011, measured_table
from mine_loc_uwb.received_power import uncompress_dbm

LAWS = [aps011(bandwidth, prf) for bandwidth in (500, 900) for prf in (16, 64)]


@pytest.mark.parametrize(
    ("bandwidth_mhz", "prf_mhz", "level_dbm", "bias_mm"),
    [
        (500, 64, -61, -110),
        (500, 64, -77, 0),
        (500, 64, -95, 86),
        (500, 16, -61, -198),
        (500, 16, -81, 0),
        (500, 16, -95, 112),
        (900, 16, -75, 0),
        (900, 16, -95, 394),
        (900, 64, -61, -295),
        (900, 64, -89, 233),
    ],
)
def test_entries_of_the_application_note(bandwidth_mhz, prf_mhz, level_dbm, bias_mm):
    assert aps011(bandwidth_mhz, prf_mhz).at_level_m(np.array(float(level_dbm))) == pytest.approx(1e-3 * bias_mm)


def test_between_entries_it_is_linear_and_beyond_them_held():
    bias_m = aps011(500, 64).at_level_m(np.array([-80.0, -40.0, -130.0]))
    assert bias_m == pytest.approx([0.028, -0.110, 0.086])


def test_a_weak_signal_reads_long():
    assert aps011(500, 64).at_level_m(np.array(-90.0)) > 0.0 > aps011(500, 64).at_level_m(np.array(-65.0))


@pytest.mark.parametrize("law", LAWS)
@given(st.lists(st.floats(-130.0, -40.0), min_size=2, max_size=20))
def test_bias_never_rises_with_the_level(law, levels):
    assert np.all(np.diff(law.at_level_m(np.sort(levels))) <= 1e-12)


def test_reported_powers_are_expanded_before_the_note_is_asked():
    law = aps011(500, 64)
    reported = np.array([-95.0, -88.0, -80.0])
    assert law.at_reported_power_m(reported) == pytest.approx(law.at_level_m(uncompress_dbm(reported, 64)))
    assert law.at_reported_power_m(np.array(-80.0)) < law.at_level_m(np.array(-80.0))


def test_a_table_of_the_sites_own_is_asked_with_powers_as_reported():
    own = PowerBias("table", (-90.0, -80.0), (0.1, -0.1))
    assert own.at_reported_power_m(np.array([-85.0, -80.0])) == pytest.approx([0.0, -0.1])


@pytest.mark.parametrize("law", [NO_POWER_BIAS, *LAWS, PowerBias("table", (-90.0, -80.0), (0.1, -0.1))])
def test_an_unknown_power_has_no_bias(law):
    assert law.at_reported_power_m(np.array([np.nan, -np.inf, np.inf])).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(("bandwidth_mhz", "prf_mhz"), [(499, 64), (900, 62), (64, 500)])
def test_a_radio_that_the_note_does_not_know_is_refused_with_what_is_allowed(bandwidth_mhz, prf_mhz):
    with pytest.raises(ConfigurationError, match=f"bandwidth_mhz {bandwidth_mhz}, prf_mhz {prf_mhz}; allowed: 500"):
        aps011(bandwidth_mhz, prf_mhz)


def test_a_measured_table_finds_the_law_and_leaves_the_constant_to_the_antenna_delay():
    rng = np.random.default_rng(1)
    power_dbm = rng.uniform(-95.0, -80.0, 4000)
    error_m = 0.5 - 0.02 * (power_dbm + 88.0) + rng.normal(0.0, 0.05, 4000)
    law = measured_table(power_dbm, error_m)
    assert law.at_reported_power_m(power_dbm) == pytest.approx(-0.02 * (power_dbm + 87.5), abs=0.03)


def test_a_few_pairs_make_no_table():
    assert measured_table(np.full(50, -80.0), np.zeros(50)) is NO_POWER_BIAS
    assert measured_table(np.array([]), np.array([])) is NO_POWER_BIAS
    assert measured_table(np.full(100, np.nan), np.zeros(100)) is NO_POWER_BIAS
