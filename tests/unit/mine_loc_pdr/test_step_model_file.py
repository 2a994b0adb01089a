"""The step model's file: the same weights after a round trip, and what does not fit refused with its reason."""

import json

import numpy as np
import pytest

from mine_loc_core.errors import ConfigurationError
from mine_loc_pdr.model_file import MOST_BYTES
from mine_loc_pdr.step_kernel import WEIGHTS
from mine_loc_pdr.step_model_file import load_step_model, save_step_model, shipped_step_model


def changed(tmp_path, **arrays):
    """A copy of the shipped file with some arrays in place of its own; None leaves one out."""
    with np.load(shipped_step_model(), allow_pickle=False) as file:
        whole = {name: file[name] for name in file.files} | arrays
    path = tmp_path / "changed.npz"
    np.savez(path, **{name: array for name, array in whole.items() if array is not None})
    return path


def test_what_is_saved_is_loaded(tmp_path):
    model, _ = load_step_model(shipped_step_model())
    save_step_model(tmp_path / "new" / "model.npz", model, {"version": "a"})
    again, card = load_step_model(tmp_path / "new" / "model.npz")
    assert card["version"] == "a"
    assert again.threshold == model.threshold
    np.testing.assert_array_equal(again.weights, model.weights)


def test_the_shipped_model_is_small_and_its_card_says_what_it_learnt_of():
    _, card = load_step_model(shipped_step_model())
    assert shipped_step_model().stat().st_size < MOST_BYTES
    assert {"data", "recorded_people", "steps", "seed", "rounds", "input_contract"} <= set(card)


@pytest.mark.parametrize(
    ("arrays", "reason"),
    [
        ({"weights": None}, "weights is missing"),
        ({"weights": np.zeros(WEIGHTS - 1, np.float32)}, "weights is float32"),
        ({"weights": np.zeros(WEIGHTS)}, "weights is float64"),
        ({"weights": np.full(WEIGHTS, np.nan, np.float32)}, "weights is not finite"),
        ({"threshold": np.array(1.5)}, "threshold 1.5"),
        ({"card": np.array(json.dumps({"input_contract": {"taps": 3}}))}, "input_contract"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path, arrays, reason):
    with pytest.raises(ConfigurationError, match=reason):
        load_step_model(changed(tmp_path, **arrays))


def test_a_file_that_is_not_there_is_refused_with_what_writes_one(tmp_path):
    with pytest.raises(ConfigurationError, match="mine-loc train-steps"):
        load_step_model(tmp_path / "none.npz")
