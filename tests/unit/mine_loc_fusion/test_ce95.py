"""The circle of 95 %."""

import numpy as np
import pytest

from mine_loc_core.gates import chi2_quantile
from mine_loc_fusion.estimate import ce95_m


@pytest.mark.parametrize("seed", range(5))
def test_it_is_the_quantile_of_the_longer_axis(seed):
    half = np.random.default_rng(seed).standard_normal((2, 2)) * [1.0, 10.0**-seed]
    longest = np.linalg.eigvalsh(half @ half.T)[-1]
    assert ce95_m(half @ half.T) == pytest.approx(np.sqrt(longest * chi2_quantile(0.95, 2)))


def test_nothing_spread_has_no_circle():
    assert ce95_m(np.zeros((2, 2))) == 0.0
