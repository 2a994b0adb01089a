"""Levels: what the model says of them, ranges read from them without bias, and the fit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_uwb.path_loss import PathLoss, fit_path_loss

CM8 = PathLoss(-71.0, 2.15, 6.0)


def test_a_decade_of_range_costs_ten_exponents():
    assert CM8.level_dbm(np.array([1.0, 10.0, 100.0])) == pytest.approx([-71.0, -92.5, -114.0])


@given(st.floats(0.1, 200.0), st.floats(0.8, 4.0))
def test_the_median_range_reads_the_level_backwards(range_m, exponent):
    model = PathLoss(-60.0, exponent, 3.0)
    assert model.median_range_m(model.level_dbm(np.array(range_m))) == pytest.approx(range_m)


@given(st.floats(0.2, 200.0))
def test_the_slope_is_the_derivative(range_m):
    step = 1e-5 * range_m
    difference = CM8.level_dbm(np.array(range_m + step)) - CM8.level_dbm(np.array(range_m - step))
    assert CM8.slope_db_per_m(np.array(range_m)) == pytest.approx(difference / (2 * step), rel=1e-4)


@pytest.mark.parametrize("power", [1, 2])
def test_ranges_read_from_shadowed_levels_are_right_on_average_and_scatter_as_claimed(power):
    model, range_m = PathLoss(-71.0, 2.15, 3.0), 12.0
    levels = model.level_dbm(np.full(200_000, range_m)) + 3.0 * np.random.default_rng(1).standard_normal(200_000)
    read, share = model.power_of_range(levels, power)
    assert read.mean() == pytest.approx(range_m**power, rel=0.01)
    assert read.std() == pytest.approx(share * range_m**power, rel=0.1)


def test_levels_are_finite_at_no_range_at_all():
    assert np.isfinite(CM8.level_dbm(np.array([0.0]))).all()
    assert np.isfinite(CM8.slope_db_per_m(np.array([0.0]))).all()


def test_the_fit_finds_what_made_the_pairs_and_leaves_out_what_was_not_heard():
    rng = np.random.default_rng(2)
    range_m = rng.uniform(1.0, 60.0, 20_000)
    level_dbm = CM8.level_dbm(range_m) + 6.0 * rng.standard_normal(20_000)
    level_dbm[::7] = np.nan
    fit = fit_path_loss(range_m, level_dbm)
    assert (fit.level_1m_dbm, fit.exponent, fit.shadowing_db) == pytest.approx((-71.0, 2.15, 6.0), rel=0.02)


@pytest.mark.parametrize(
    ("range_m", "level_dbm", "complaint"),
    [
        ([1.0, 2.0], [-70.0, -80.0], "2 pairs"),
        ([5.0, 5.0, 5.0, 5.0], [-70.0, -80.0, -75.0, -77.0], "different ranges"),
        ([1.0, 10.0, 100.0], [-90.0, -80.0, -70.0], "must fall"),
        ([1.0, 10.0, 100.0], [np.nan, -80.0, -90.0], "2 pairs"),
    ],
)
def test_pairs_that_determine_no_path_loss_are_refused(range_m, level_dbm, complaint):
    with pytest.raises(ValueError, match=complaint):
        fit_path_loss(np.array(range_m), np.array(level_dbm))
