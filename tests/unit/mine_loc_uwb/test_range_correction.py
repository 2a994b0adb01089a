import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.power_bias import PowerBias, aps011
from mine_loc_uwb.range_calibration import CalibrationOptions, calibrate, fit_correction
from mine_loc_uwb.range_correction import RangeCorrection
from mine_loc_uwb.range_pairs import RangePairs
from mine_loc_uwb.range_polynomial import RangePolynomial

ONE_METRE_LONG = RangePolynomial((4.0, 19.0), (5.0, 20.0), 0.5)
POWER = PowerBias("table", (-90.0, -80.0), (0.2, -0.1))


def corrected(correction, range_m, power_dbm=np.nan, nlos=0.0, anchor_offset_m=0.0):
    found = correction.correct(np.array([range_m]), np.array([power_dbm]), np.array([nlos]), anchor_offset_m)
    return found.range_m[0], found.bias_m[0], found.added_variance_m2[0]


def test_the_default_corrects_nothing():
    assert corrected(RangeCorrection(), 12.3, -85.0, 1.0) == (12.3, 0.0, 0.0)


def test_an_antenna_offset_is_subtracted_and_an_anchors_own_on_top():
    assert corrected(RangeCorrection(antenna_offset_m=0.3), 12.0) == pytest.approx((11.7, 0.3, 0.0))
    assert corrected(RangeCorrection(antenna_offset_m=0.3), 12.0, anchor_offset_m=0.1) == pytest.approx(
        (11.6, 0.4, 0.0)
    )


def test_a_weak_link_that_reads_long_is_made_shorter_and_a_strong_one_longer():
    correction = RangeCorrection(power_bias=aps011(500, 64))
    assert corrected(correction, 12.0, -95.0)[0] == pytest.approx(12.0 - 0.086)
    assert corrected(correction, 12.0, -79.0)[0] > 12.0


def test_a_link_without_line_of_sight_is_corrected_by_the_polynomial_and_one_with_it_is_not():
    correction = RangeCorrection(nlos=ONE_METRE_LONG)
    assert corrected(correction, 12.0, nlos=1.0) == pytest.approx((11.0, 1.0, 0.25))
    assert corrected(correction, 12.0, nlos=0.0) == (12.0, 0.0, 0.0)


def test_in_doubt_it_is_corrected_in_part_and_the_doubt_is_in_the_variance():
    found = corrected(RangeCorrection(nlos=ONE_METRE_LONG), 12.0, nlos=0.3)
    assert found == pytest.approx((11.7, 0.3, 0.3 * 0.25 + 0.3 * 0.7 * 1.0))


def test_mean_and_variance_are_those_of_the_mixture():
    rng = np.random.default_rng(2)
    hidden = rng.random(200_000) < 0.3
    true_m = np.where(hidden, 11.0 + rng.normal(0.0, 0.5, 200_000), 12.0)
    range_m, _, variance_m2 = corrected(RangeCorrection(nlos=ONE_METRE_LONG), 12.0, nlos=0.3)
    assert range_m == pytest.approx(true_m.mean(), abs=0.01)
    assert variance_m2 == pytest.approx(true_m.var(), abs=0.01)


def test_each_stage_works_on_what_the_one_before_has_left():
    correction = RangeCorrection(1.0, POWER, RangePolynomial((4.0, 14.0), (5.0, 25.0), 0.5))
    left_m = 20.0 - 1.0 - 0.2
    assert corrected(correction, 20.0, -90.0, 1.0)[0] == pytest.approx(4.0 + (left_m - 5.0) * 0.5)


def test_where_the_polynomial_does_not_reach_its_excess_is_in_the_variance_instead():
    range_m, bias_m, variance_m2 = corrected(RangeCorrection(nlos=ONE_METRE_LONG), 80.0, nlos=1.0)
    assert (range_m, bias_m) == (80.0, 0.0)
    assert variance_m2 == pytest.approx(0.25 + 1.0)


def test_what_was_not_judged_is_left_as_it_is():
    assert corrected(RangeCorrection(nlos=ONE_METRE_LONG), 12.0, nlos=np.nan) == (12.0, 0.0, 0.0)


@pytest.mark.parametrize("nlos", [0.0, 0.5, 1.0, np.nan])
def test_a_range_that_was_not_measured_stays_so_with_a_finite_variance(nlos):
    range_m, _, variance_m2 = corrected(RangeCorrection(0.1, POWER, ONE_METRE_LONG), np.nan, -85.0, nlos)
    assert np.isnan(range_m)
    assert variance_m2 >= 0.0


numbers = st.floats(allow_nan=True, allow_infinity=True)


@given(numbers, numbers, numbers)
def test_any_numbers_give_a_variance_that_is_finite_and_not_negative(range_m, power_dbm, nlos):
    with np.errstate(invalid="ignore", over="ignore"):
        found = corrected(RangeCorrection(0.1, POWER, ONE_METRE_LONG), range_m, power_dbm, nlos)
    assert 0.0 <= found[2] < np.inf
    assert np.isnan(found[0]) == np.isnan(range_m)


@given(st.floats(0.0, 100.0), st.floats(-100.0, -70.0), st.floats(0.0, 1.0))
def test_the_bias_is_what_was_subtracted_and_arrays_do_as_single_ranges(range_m, power_dbm, nlos):
    correction = RangeCorrection(0.1, POWER, ONE_METRE_LONG)
    one = corrected(correction, range_m, power_dbm, nlos)
    assert one[0] == pytest.approx(range_m - one[1])
    many = correction.correct(np.full((2, 3), range_m), np.full((2, 3), power_dbm), np.full((2, 3), nlos))
    assert many.range_m.shape == (2, 3)
    assert many.range_m[1, 2] == one[0]


def survey(seed=1, per_place=40):
    """Pairs of 24 places with and as many without line of sight: 0.4 m antenna delay, own power law, 10 % + 0.5 m."""
    rng = np.random.default_rng(seed)
    group = np.repeat(np.arange(48), per_place)
    nlos = group >= 24
    true_m = np.tile(np.linspace(3.0, 26.0, 24), 2)[group]
    power_dbm = -78.0 - 0.6 * true_m + rng.normal(0.0, 1.0, len(group))
    measured_m = true_m + np.where(nlos, 0.5 + 0.1 * true_m, 0.0) + 0.4
    measured_m += POWER.at_reported_power_m(power_dbm) + rng.normal(0.0, 0.03, len(group))
    return RangePairs(measured_m, true_m, nlos, power_dbm, group)


def test_calibration_finds_all_stages_and_its_held_out_errors_are_small():
    found = calibrate(survey(), CalibrationOptions())
    assert found.correction.power_bias.kind == "table"
    assert found.before["NLOS"].mean_m > 2.0
    for label in ("LOS", "NLOS"):
        assert found.held_out[label].mean_absolute_m < 0.1
        assert found.held_out[label].pairs == found.before[label].pairs
        assert abs(found.after[label].mean_m) < 0.03


def test_ranges_that_firmware_has_corrected_already_get_no_law_of_power():
    pairs = survey()
    flat_m = pairs.measured_m - POWER.at_reported_power_m(pairs.receive_power_dbm)
    flat = RangePairs(flat_m, pairs.true_m, pairs.nlos, pairs.receive_power_dbm, pairs.group)
    assert fit_correction(flat, CalibrationOptions()).power_bias.kind == "none"
    asked = fit_correction(flat, CalibrationOptions(power_bias="aps011", bandwidth_mhz=900, prf_mhz=16))
    assert asked.power_bias == aps011(900, 16)


def test_with_one_kind_of_link_only_its_stages_are_fitted():
    pairs = survey()
    clear = fit_correction(pairs.only(~pairs.nlos), CalibrationOptions())
    assert clear.nlos is None
    assert clear.antenna_offset_m == pytest.approx(0.5, abs=0.03)  # 0.4 and the law's middle, 0.1
    hidden = fit_correction(pairs.only(pairs.nlos), CalibrationOptions())
    assert hidden.antenna_offset_m == 0.0
    assert hidden.nlos is not None


def test_no_pairs_are_refused():
    pairs = survey()
    with pytest.raises(ConfigurationError, match="pairs: none; allowed"):
        calibrate(pairs.only(np.zeros(len(pairs), bool)), CalibrationOptions())
