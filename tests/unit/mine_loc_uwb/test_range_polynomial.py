import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.polynomial_fit import fit_polynomial
from mine_loc_uwb.range_pairs import groups_by_distance
from mine_loc_uwb.range_polynomial import RangePolynomial

EXAMPLE = RangePolynomial((4.0, 6.0, 7.0, 11.0), (5.0, 15.0), 0.3)


@st.composite
def polynomials(draw):
    steps = draw(st.lists(st.floats(0.01, 30.0), min_size=2, max_size=9))
    low_m = draw(st.floats(0.0, 50.0))
    return RangePolynomial(tuple(np.cumsum(steps)), (low_m, low_m + draw(st.floats(0.5, 100.0))), 0.3)


def pairs(law, seed=1, count=600, places=40, tail=0.0):
    """Measured and true ranges and groups, a group a place; a share `tail` of the ranges is far too long."""
    rng = np.random.default_rng(seed)
    group = np.arange(count) % places
    measured_m = rng.uniform(3.0, 30.0, places)[group] + rng.normal(0.0, 0.3, count)
    true_m = law(measured_m) + rng.normal(0.0, 0.05, count)
    return measured_m + np.where(rng.random(count) < tail, rng.exponential(3.0, count), 0.0), true_m, group


@given(polynomials())
def test_outside_of_the_valid_interval_it_is_exactly_the_identity(polynomial):
    low_m, high_m = polynomial.valid_m
    outside = np.array([low_m, -1.0, high_m, high_m + 0.01, 1e6])
    outside = outside[(outside <= low_m) | (outside >= high_m)]
    if low_m == polynomial.fitted_m[0]:
        outside = outside[outside != low_m]
    assert np.array_equal(polynomial.true_range_m(outside), outside)


@given(polynomials())
def test_true_ranges_rise_with_measured_ones_without_a_jump(polynomial):
    assert polynomial.rises()
    low_m, high_m = polynomial.valid_m
    assert low_m <= polynomial.fitted_m[0] < polynomial.fitted_m[1] < high_m
    measured_m = np.linspace(max(low_m, 1e-6), high_m + 1.0, 4001)
    true_m = polynomial.true_range_m(measured_m)
    assert np.all(np.diff(true_m) > -1e-9)
    steepest = max(polynomial.degree * np.diff(polynomial.control_m).max() / np.ptp(polynomial.fitted_m), 2.0)
    if polynomial.fitted_m[0] > polynomial.control_m[0] or low_m > 0.0:
        assert np.diff(true_m).max() <= 1.01 * steepest * (measured_m[1] - measured_m[0])
    assert np.all(true_m > 0.0)


def test_one_that_falls_somewhere_or_gives_negative_ranges_does_not_rise():
    assert not RangePolynomial((4.0, 3.0, 11.0), (5.0, 15.0), 0.3).rises()
    assert not RangePolynomial((-0.1, 3.0, 11.0), (5.0, 15.0), 0.3).rises()
    assert not RangePolynomial((4.0, 4.0), (5.0, 15.0), 0.3).rises()


def test_nan_stays_nan_and_shapes_are_kept():
    out = EXAMPLE.true_range_m(np.array([[np.nan, 10.0], [40.0, 5.0]]))
    assert out.shape == (2, 2)
    assert np.isnan(out[0, 0])
    assert out[1].tolist() == [40.0, 4.0]


def test_its_powers_are_those_of_the_paper():
    measured_m = np.linspace(5.0, 15.0, 7)
    summed = sum(a * measured_m**k for k, a in enumerate(EXAMPLE.powers()))
    assert summed == pytest.approx(EXAMPLE.true_range_m(measured_m))


def test_least_squares_of_a_law_that_rises_is_that_of_numpy():
    measured_m, true_m, group = pairs(lambda d: 0.8 * d - 0.2)
    found = fit_polynomial(measured_m, true_m, group, loss="squares", max_degree=1).polynomial
    low_m, high_m = found.fitted_m
    used = (measured_m >= low_m) & (measured_m <= high_m)
    expected = np.polynomial.Polynomial.fit(measured_m[used], true_m[used], 1).convert().coef
    assert found.powers() == pytest.approx(expected.tolist(), rel=1e-6)


def test_ranges_of_a_kilometre_lose_no_digits():
    measured_m = np.linspace(900.0, 1000.0, 400)
    group = np.arange(400) // 10
    found = fit_polynomial(measured_m, measured_m - 1.5, group, loss="squares", max_degree=6).polynomial
    assert found.true_range_m(measured_m[5:-5]) == pytest.approx(measured_m[5:-5] - 1.5, abs=1e-6)


def test_the_degree_is_no_higher_than_the_law_needs():
    straight = [fit_polynomial(*pairs(lambda d: 0.9 * d - 0.5, seed)) for seed in range(5)]
    assert [fit.polynomial.degree for fit in straight] == [1] * 5
    bent = fit_polynomial(*pairs(lambda d: d - 1.5 - 1.3 * np.sin(d / 3.5)))
    assert bent.polynomial.degree >= 3
    assert bent.loss_m_by_degree[bent.polynomial.degree - 1] < 0.8 * bent.loss_m_by_degree[0]


def test_a_tail_of_long_ranges_does_not_draw_the_curve():
    def law(d):
        return 0.9 * d - 0.5

    measured_m, true_m, group = pairs(law, tail=0.15)
    clean_m = np.linspace(5.0, 28.0, 50)
    off_m = {
        loss: np.abs(
            fit_polynomial(measured_m, true_m, group, loss=loss).polynomial.true_range_m(clean_m) - law(clean_m)
        )
        for loss in ("absolute", "squares")
    }
    assert off_m["absolute"].max() < 0.15
    assert off_m["squares"].max() > 2.0 * off_m["absolute"].max()


def test_places_are_held_out_whole():
    """Each place has an error of its own: pairs parted within places would promise a residual of 1 cm."""
    rng = np.random.default_rng(3)
    group = np.repeat(np.arange(6), 30)
    true_m = np.linspace(3.0, 30.0, 6)[group]
    measured_m = true_m + np.array([0.0, 1.0, -1.0, 1.0, -1.0, 0.0])[group] + rng.normal(0.0, 0.01, 180)
    fit = fit_polynomial(measured_m, true_m, group)
    assert fit.polynomial.residual_sd_m > 0.5
    assert min(fit.loss_m_by_degree) > 0.5
    left_m = fit.held_out_m - true_m
    assert fit.polynomial.residual_sd_m == pytest.approx(np.sqrt(np.mean(left_m**2)))
    assert fit.loss_m_by_degree[fit.polynomial.degree - 1] == pytest.approx(np.abs(left_m).mean())


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.sampled_from(["absolute", "squares"]))
def test_whatever_the_pairs_the_polynomial_rises(seed, loss):
    rng = np.random.default_rng(seed)
    found = fit_polynomial(rng.uniform(0, 20, 60), rng.uniform(0, 20, 60), np.arange(60) // 6, loss=loss, max_degree=4)
    assert found.polynomial.rises()
    assert np.isfinite(found.polynomial.residual_sd_m)


@pytest.mark.parametrize(("count", "groups"), [(19, 19), (100, 1)])
def test_too_few_pairs_or_places_are_refused_with_their_number(count, groups):
    with pytest.raises(ConfigurationError, match=f"{count} in {groups} groups; allowed: 20 or more in at least 2"):
        fit_polynomial(np.arange(count) + 1.0, np.arange(count) + 1.0, np.arange(count) % groups)


def test_pairs_without_groups_are_grouped_by_distance_where_distances_repeat_else_by_order():
    assert groups_by_distance(np.repeat([2.0, 4.0, 6.0], 5)).tolist() == [0] * 5 + [1] * 5 + [2] * 5
    blocks = groups_by_distance(np.linspace(1.0, 9.0, 100))
    assert len(np.unique(blocks)) == 20
    assert np.all(np.diff(blocks) >= 0)
