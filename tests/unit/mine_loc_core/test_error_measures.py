"""The words of ISO/IEC 18305."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mine_loc_core.error_measures import availability, horizontal_error


def test_the_measures_of_a_known_set():
    measures = horizontal_error(np.arange(101.0))
    assert measures.count == 101
    assert (measures.mean_m, measures.median_m, measures.third_quartile_m) == (50.0, 50.0, 75.0)
    assert (measures.ce95_m, measures.max_m) == (95.0, 100.0)
    assert measures.rmse_m == pytest.approx(np.sqrt(np.mean(np.arange(101.0) ** 2)))


@given(arrays(np.float64, st.tuples(st.integers(1, 50), st.just(2)), elements=st.floats(-1e6, 1e6)))
def test_the_measures_are_in_order_and_the_same_for_vectors_and_distances(errors_m):
    measures = horizontal_error(errors_m)
    assert measures == horizontal_error(np.linalg.norm(errors_m, axis=1))
    assert 0 <= measures.median_m <= measures.third_quartile_m <= measures.ce95_m <= measures.max_m
    assert measures.mean_m <= measures.rmse_m * (1 + 1e-12) <= measures.max_m * (1 + 1e-9)


@pytest.mark.parametrize("errors_m", [[], [1.0, np.nan], [np.inf]])
def test_no_errors_or_errors_that_are_not_finite_are_refused(errors_m):
    with pytest.raises(ValueError, match="finite"):
        horizontal_error(np.array(errors_m))


def test_availability_is_the_share_of_instants_with_a_fresh_output():
    outputs_s = np.concatenate([np.arange(0.0, 4.0, 0.1), np.arange(6.0, 10.0, 0.1)])
    assert availability(outputs_s, 0.0, 10.0, max_age_s=0.5) == pytest.approx(0.84, abs=0.01)  # silent 4.4 s to 6 s
    assert availability(outputs_s[::-1], 0.0, 10.0, max_age_s=0.5) == availability(outputs_s, 0.0, 10.0, max_age_s=0.5)


def test_what_comes_before_the_first_output_is_not_available():
    assert availability(np.array([9.0]), 0.0, 10.0, max_age_s=5.0) == pytest.approx(0.1, abs=0.01)
    assert availability(np.array([]), 0.0, 10.0, max_age_s=5.0) == 0.0
    assert availability(np.array([1.0]), 5.0, 5.0, max_age_s=5.0) == 0.0
