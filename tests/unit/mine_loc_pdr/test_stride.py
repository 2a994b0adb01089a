"""Step length by paper B's linear model."""

import pytest

from mine_loc_pdr.stride import StrideModel


def test_the_reference_person_at_the_reference_frequency_steps_seventy_centimetres():
    assert StrideModel(1.75).length_m(1.79) == pytest.approx(0.7)
    assert StrideModel(1.75).length_m(None) == pytest.approx(0.7)


def test_the_model_is_paper_b_equation_2():
    model = StrideModel(1.60, alpha=0.4, beta=0.3, scale=0.9)
    assert model.length_m(2.0) == pytest.approx((0.7 + 0.4 * (1.60 - 1.75) + 0.3 * (2.0 - 1.79) * 1.60 / 1.75) * 0.9)


def test_the_taller_and_the_faster_take_longer_steps():
    assert StrideModel(1.90).length_m(1.8) > StrideModel(1.60).length_m(1.8)
    assert StrideModel(1.75).length_m(2.2) > StrideModel(1.75).length_m(1.5)


def test_the_shared_error_is_that_of_the_scale():
    model = StrideModel(1.75, scale=2.0, scale_variance=0.01)
    assert model.common_variance_m2(1.4) == pytest.approx((0.1 * 0.7) ** 2)
