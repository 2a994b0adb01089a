"""The model's file: the same decisions after a round trip, nothing executed, and what does not fit refused."""

import json
import pickle
import zipfile

import numpy as np
import pytest
from activity_samples import window

from mine_loc_core.errors import ConfigurationError
from mine_loc_pdr.activity_model_file import load_model, save_model, shipped_model
from mine_loc_pdr.model_file import MOST_BYTES


@pytest.fixture
def shipped():
    return load_model(shipped_model())


def arrays_of(path):
    with np.load(path, allow_pickle=False) as file:
        return {name: file[name] for name in file.files}


def changed(tmp_path, **arrays):
    """A copy of the shipped file with some arrays in place of its own; None leaves one out."""
    whole = arrays_of(shipped_model()) | arrays
    path = tmp_path / "changed.npz"
    np.savez(path, **{name: array for name, array in whole.items() if array is not None})
    return path


def changed_card(tmp_path, **entries):
    card = json.loads(str(arrays_of(shipped_model())["card"]))
    return changed(tmp_path, card=np.array(json.dumps(card | entries)))


def test_what_is_saved_is_loaded(tmp_path, shipped):
    model, card = shipped
    save_model(tmp_path / "new" / "model.npz", model, {"version": "a"})
    again, card_again = load_model(tmp_path / "new" / "model.npz")
    assert card_again["version"] == "a"
    assert card_again["features"] == card["features"]
    for turn_deg in (0.0, 20.0, 25.0, 90.0):
        assert again.judge(window(turn_deg)) == model.judge(window(turn_deg))


def test_the_shipped_model_is_small_and_its_card_says_what_it_learnt_of_and_how_it_scored(shipped):
    _, card = shipped
    assert shipped_model().stat().st_size < MOST_BYTES
    assert {"data", "protocol", "windows", "figures", "input_contract"} <= set(card)
    assert card["figures"]["balanced_accuracy"] > 0.99


def test_a_pickle_in_the_file_is_refused_and_not_executed(tmp_path):
    class Trap:
        def __reduce__(self):
            return exec, (f"open({str(tmp_path / 'ran')!r}, 'w')",)

    with pytest.raises(ConfigurationError, match="without pickle"):
        load_model(changed(tmp_path, mean=np.array([Trap()], dtype=object)))
    assert not (tmp_path / "ran").exists()


def test_a_bare_pickle_or_any_other_file_is_refused(tmp_path):
    path = tmp_path / "model.npz"
    for content in (b"", b"no model", pickle.dumps({"mean": 1})):
        path.write_bytes(content)
        with pytest.raises(ConfigurationError, match="npz without pickle"):
            load_model(path)
    with pytest.raises(ConfigurationError, match="no such file"):
        load_model(tmp_path / "absent.npz")


def test_a_file_that_unpacks_to_more_than_it_may_be_is_refused_unread(tmp_path):
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("card.npy", bytes(10 * MOST_BYTES))
    assert path.stat().st_size < MOST_BYTES
    with pytest.raises(ConfigurationError, match=f"allowed: up to {MOST_BYTES}"):
        load_model(path)


@pytest.mark.parametrize(
    ("name", "array"),
    [
        ("mean", None),
        ("mean", np.zeros(2)),
        ("scale", np.zeros((10, 1))),
        ("coefficient", np.zeros(3)),
        ("support", np.zeros(5)),
        ("support", np.zeros((336, 10), dtype=np.float32)),
        ("intercept", np.zeros(2)),
        ("walking", np.zeros(3)),
    ],
)
def test_numbers_that_do_not_belong_together_are_refused_by_name(tmp_path, name, array):
    with pytest.raises(ConfigurationError, match=f"{name} is"):
        load_model(changed(tmp_path, **{name: array}))


def test_numbers_that_are_none_are_refused(tmp_path):
    support = arrays_of(shipped_model())["support"].copy()
    support[0, 0] = np.nan
    with pytest.raises(ConfigurationError, match="support is not finite"):
        load_model(changed(tmp_path, support=support))
    with pytest.raises(ConfigurationError, match="scale"):
        load_model(changed(tmp_path, scale=np.zeros_like(arrays_of(shipped_model())["scale"])))


@pytest.mark.parametrize(
    ("entry", "value"),
    [("features", "tea leaves"), ("kernel", "sigmoid"), ("input_contract", {"bins": 8}), ("features", "turn")],
)
def test_a_model_made_for_something_else_is_refused(tmp_path, entry, value):
    with pytest.raises(ConfigurationError):
        load_model(changed_card(tmp_path, **{entry: value}))


def test_a_card_that_is_no_object_is_refused(tmp_path):
    with pytest.raises(ConfigurationError, match="card"):
        load_model(changed(tmp_path, card=np.array("[]")))
