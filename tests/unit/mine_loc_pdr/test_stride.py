"""Step length by paper B's linear model and by the pendulum, and their scale from walks of known length."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.people import Person, Stride
from mine_loc_pdr.stride import PendulumStrideModel, StrideModel, common_variance_m2, stride_model, vertical_swing
from mine_loc_pdr.stride_calibration import WALK_TO_WALK_SD, calibrate_scale


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
    assert common_variance_m2(model, 1.4) == pytest.approx((0.1 * 0.7) ** 2)


def test_the_pendulum_steps_further_with_more_swing_height_and_time():
    model = PendulumStrideModel(1.75)
    usual = model.length_m(1.79, 3.5)
    assert 0.4 < usual < 0.8
    assert model.length_m(1.79, 4.0) > usual
    assert model.length_m(1.6, 3.5) > usual
    assert PendulumStrideModel(1.9).length_m(1.79, 3.5) > usual
    assert model.length_m(None, 3.5) == usual
    assert PendulumStrideModel(1.75, scale=1.1).length_m(1.79, 3.5) == pytest.approx(1.1 * usual)


@pytest.mark.parametrize(("steps", "begun_rad"), [(1, 0.0), (2, 1.0), (5, -2.5)])
def test_the_swing_is_the_way_from_valley_to_peak_in_the_rhythm_of_the_steps(steps, begun_rad):
    phase_rad = np.linspace(0.0, math.tau * steps, 60 * steps, endpoint=False)
    rise = 2.5 * np.cos(phase_rad + begun_rad)
    knock = np.where(phase_rad % math.tau < 0.3, 8.0, 0.0)
    assert vertical_swing(phase_rad, 9.8 + rise) == pytest.approx(5.0)
    assert vertical_swing(phase_rad, 2.5 * np.cos(3.0 * phase_rad)) == pytest.approx(0.0, abs=1e-9)
    assert abs(vertical_swing(phase_rad, rise + knock) - 5.0) < 0.2 * np.ptp(rise + knock)


def test_a_bouncier_walk_is_longer_but_by_less_than_a_pendulum_s():
    model = PendulumStrideModel(1.75)
    assert model.length_m(1.79, 4.0) == pytest.approx(2.0**0.375 * model.length_m(1.79, 2.0))


def test_a_pause_within_a_step_makes_it_no_longer():
    model = PendulumStrideModel(1.75)
    assert model.length_m(1.0, 3.5) == model.length_m(0.8, 3.5) > model.length_m(1.4, 3.5)


def test_no_knock_makes_a_step_longer_than_people_are_able_to():
    assert PendulumStrideModel(1.75).length_m(1.79, 2000.0) == PendulumStrideModel(1.75).length_m(0.7, 50.0)
    assert PendulumStrideModel(1.75).length_m(1.79, 2000.0) == pytest.approx(0.6 * 1.75)


def test_the_person_chooses_the_model():
    linear = Person("a", 0, 1.8, None, Stride(0.9, 0.3, 0.2, "paper_b"), None)
    pendulum = Person("a", 0, 1.8, None, Stride(0.9), None)
    assert stride_model(linear) == StrideModel(1.8, 0.3, 0.2, 0.9)
    assert stride_model(pendulum) == PendulumStrideModel(1.8, 0.9)


@given(st.floats(0.5, 2.0), st.lists(st.floats(5.0, 100.0), min_size=1, max_size=8))
def test_walks_that_are_all_a_factor_off_give_that_factor(scale, modelled):
    found = calibrate_scale([scale * m for m in modelled], modelled)
    assert found.scale == pytest.approx(scale)
    assert found.standard_error == pytest.approx(WALK_TO_WALK_SD * scale / math.sqrt(len(modelled)))


def test_walks_that_disagree_make_the_scale_unsure():
    found = calibrate_scale([20.0, 20.0], [16.0, 25.0])
    assert found.spread > 0.2
    assert found.standard_error == pytest.approx(found.spread / math.sqrt(2))


@pytest.mark.parametrize(("walked", "modelled"), [([], []), ([20.0], []), ([0.0], [1.0]), ([20.0], [math.nan])])
def test_what_is_no_walk_is_refused(walked, modelled):
    with pytest.raises(ValueError, match="lengths"):
        calibrate_scale(walked, modelled)
