"""Figures of merit by hand, and the area under the curve against its definition."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_uwb.los_calibration import fit_temperature
from mine_loc_uwb.los_measures import area_under_curve, binary_measures, class_measures, over_seeds, reliability


def test_figures_of_two_placements_by_hand():
    probability = np.array([0.9, 0.8, 0.4, 0.2, 0.6])
    los = np.array([True, True, True, False, False])
    found = binary_measures(probability, los, np.array([1, 1, 1, 2, 3]))
    assert found["accuracy"] == pytest.approx(3 / 5)
    assert found["balanced_accuracy"] == pytest.approx((2 / 3 + 1 / 2) / 2)
    assert found["placement_balanced_accuracy"] == pytest.approx((2 / 3 + (1 + 0) / 2) / 2)
    assert found["confusion"] == [[2, 1], [1, 1]]
    assert (found["recall"], found["precision"], found["f1"]) == (0.5, 0.5, 0.5)
    assert found["auc"] == pytest.approx(5 / 6)
    assert found["brier"] == pytest.approx((0.01 + 0.04 + 0.36 + 0.04 + 0.36) / 5)
    assert found["placements"]["3"] == {"los": False, "accuracy": 0.0, "mean_los_probability": 0.6, "frames": 1}


def test_calibration_error_is_zero_for_honest_claims_and_the_distance_for_boasts():
    los = np.arange(100) % 4 == 0
    assert reliability(np.full(100, 0.25), los).expected_calibration_error == pytest.approx(0.0)
    assert reliability(np.full(100, 0.95), los).expected_calibration_error == pytest.approx(0.70)


@given(st.lists(st.tuples(st.integers(0, 5), st.booleans()), min_size=2, max_size=40))
def test_area_under_the_curve_is_the_share_of_ordered_pairs(rows):
    probability, los = np.array([p / 5 for p, _ in rows]), np.array([y for _, y in rows])
    pairs = [(a > b) + 0.5 * (a == b) for a in probability[los] for b in probability[~los]]
    found = area_under_curve(probability, los)
    assert found == pytest.approx(np.mean(pairs)) if pairs else np.isnan(found)


def test_macro_figures_of_classes_by_hand():
    found = class_measures(np.array([0, 0, 1, 1]), np.array([0, 1, 1, 1]), 2)
    assert found == {
        "accuracy": 0.75,
        "recall": pytest.approx((1 + 2 / 3) / 2),
        "f1": pytest.approx((2 / 3 + 4 / 5) / 2),
        "confusion": [[1, 0], [1, 2]],
    }


def test_a_temperature_takes_back_what_was_boasted():
    rng = np.random.default_rng(1)
    honest = 2.0 * rng.standard_normal(20_000)
    los = rng.random(20_000) < 1.0 / (1.0 + np.exp(-honest))
    weight = np.full(20_000, 1.0 / 20_000)
    assert fit_temperature(3.0 * honest, los, weight) == pytest.approx(3.0, rel=0.1)
    assert fit_temperature(0.5 * honest, los, weight) == pytest.approx(1.0, abs=0.01)


def test_spread_over_seeds_stands_beside_the_mean():
    assert over_seeds([{"a": 1.0, "b": [1]}, {"a": 3.0, "b": [2]}]) == {
        "a": 2.0,
        "a_sd": pytest.approx(2**0.5),
        "b": [1],
    }
