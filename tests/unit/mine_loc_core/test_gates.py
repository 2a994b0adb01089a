"""Gates stated as a probability."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2

from mine_loc_core.gates import chi2_quantile


@given(st.floats(1e-6, 1.0 - 1e-6), st.integers(1, 12))
def test_the_share_below_the_gate_is_the_probability_asked_for(probability, degrees_of_freedom):
    gate = chi2_quantile(probability, degrees_of_freedom)
    assert chi2.cdf(gate, degrees_of_freedom) == pytest.approx(probability, rel=1e-9)


@pytest.mark.parametrize("probability", [0.0, 1.0, -0.1, 1.1, float("nan")])
def test_what_is_no_probability_is_refused(probability):
    with pytest.raises(ValueError, match="not within"):
        chi2_quantile(probability, 2)
