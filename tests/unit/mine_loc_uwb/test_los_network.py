"""Network, training and model file: what labels inform, what evidence may do, and that files run no code."""

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from los_samples import labelled, pulses
from safetensors.torch import load_file, save_file

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.cir_input import SIDE_NAMES, LosInput, Refusal
from mine_loc_uwb.labelled_frames import allowed_classes, training_set
from mine_loc_uwb.link_judgement import LinkJudge, Method, load_classifier
from mine_loc_uwb.los_evidence import FIRST_POWER, NOISE, POWER, fit_evidence
from mine_loc_uwb.los_model_file import load_model, read_card, save_model, shipped_model
from mine_loc_uwb.los_network import LosNetwork, class_log_probability
from mine_loc_uwb.los_training import (
    TrainingOptions,
    held_out,
    inner_folds,
    log_probabilities,
    los_probability,
    negative_log_likelihood,
    select,
    train,
)
from mine_loc_uwb.training_set import Sampler, balanced_weights

QUICK = TrainingOptions(steps=40, check_every=20, batch=32)


@pytest.fixture(scope="module")
def data():
    return training_set([labelled()])[0]


@pytest.fixture(scope="module")
def trained(data):
    return list(train(data, QUICK, seed=1))[-1]


@given(st.lists(st.floats(-30, 30), min_size=3, max_size=3))
def test_class_probabilities_sum_to_one_and_los_is_three_plus_four(logits):
    probability = class_log_probability(torch.tensor([logits])).exp()[0]
    assert float(probability.sum()) == pytest.approx(1.0, abs=1e-5)
    assert float(probability[2:].sum()) == pytest.approx(1.0 / (1.0 + np.exp(-logits[0])), abs=1e-5)


def test_a_label_of_several_classes_trains_only_what_it_informs():
    logits = torch.zeros(1, 3, requires_grad=True)
    negative_log_likelihood(class_log_probability(logits), torch.from_numpy(allowed_classes(["LOS"]))).backward()
    assert logits.grad[0, 0] != 0.0
    assert logits.grad[0, 1:].tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("labels", "allowed"),
    [
        (["NLOS", "LOS"], [[1, 1, 0, 0], [0, 0, 1, 1]]),
        (["NLOS", "NDP NLOS", "4"], [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1]]),
    ],
)
def test_nlos_beside_ndp_nlos_means_obstructed(labels, allowed):
    assert allowed_classes(labels).astype(int).tolist() == allowed


def test_an_unknown_label_is_named():
    with pytest.raises(ConfigurationError, match="'maybe'; allowed: LOS"):
        allowed_classes(["LOS", "maybe"])


def test_training_tells_placements_it_never_saw(trained):
    unseen = training_set([labelled(seed=50)])[0]
    assert np.mean((los_probability(trained, unseen.input) > 0.5) == unseen.los) > 0.9
    assert np.mean((los_probability(trained, unseen.input.without_range()) > 0.5) == unseen.los) > 0.8


def test_the_same_seed_gives_the_same_network(data, trained):
    again = list(train(data, QUICK, seed=1))[-1]
    assert all(torch.equal(a, b) for a, b in zip(trained.parameters(), again.parameters(), strict=True))


@settings(max_examples=20)
@given(st.integers(0, 2**30 - 1))
def test_whatever_is_missing_probabilities_are_probabilities(hidden):
    network = LosNetwork().eval()
    network.evidence.with_range.fill_(2.0)
    side = np.ones((1, 2 * len(SIDE_NAMES)), np.float32)
    side[0, [bool(hidden >> number & 1) for number in range(side.shape[1])]] = np.nan
    frame = training_set([labelled(placements=2, frames=1)])[0].input.take(slice(0, 1))
    found = np.exp(log_probabilities(network, LosInput(frame.profile, frame.edge, side)))
    assert np.isfinite(found).all()
    assert found.sum() == pytest.approx(1.0, abs=1e-5)


def test_more_power_never_speaks_against_a_line_of_sight(data):
    """Though the labels say the opposite: a sign is never turned, the feature is left out."""
    upside_down = fit_evidence(data.input.side.astype(float), ~data.los, balanced_weights(data.los, data.placement))
    assert upside_down.with_range[:2] == (0.0, 0.0)
    right = fit_evidence(data.input.side.astype(float), data.los, balanced_weights(data.los, data.placement))
    assert right.with_range[0] > 0.5
    network = LosNetwork()
    network.evidence.set(right)
    side = torch.zeros(3, 2 * len(SIDE_NAMES))
    side[:, POWER], side[:, FIRST_POWER] = torch.tensor([-6.0, -1.0, 1.0]), -5.0
    assert torch.all(network.evidence(side).diff() > 0.0)
    side[:, [POWER, NOISE]] = torch.nan
    assert network.evidence(side).isnan().all()


def test_every_placement_is_drawn_as_often_whatever_its_frames(data):
    uneven = data.take(np.r_[0:12, 12:14, 24:96])
    drawn = uneven.placement[Sampler(uneven, np.random.default_rng(1)).draw(40_000)]
    assert np.bincount(drawn) / 40_000 == pytest.approx(np.full(8, 1 / 8), abs=0.01)


def test_inner_folds_hold_out_whole_placements_of_both_kinds_once(data):
    folds = inner_folds(data, 3, seed=1)
    assert sorted(np.concatenate(folds)) == list(range(8))
    assert all({place % 2 for place in fold.tolist()} == {0, 1} for fold in folds)


def test_selection_takes_the_step_that_is_best_on_held_out_placements(data):
    judged = held_out(data, np.array([0, 1]), QUICK, seed=1)
    worse = replace(
        judged, logits=np.stack([judged.logits[0], -judged.logits[0]]), logits_no_range=judged.logits[[0, 0]]
    )
    chosen = select([worse], QUICK)
    assert chosen.steps == QUICK.check_every
    assert min(chosen.temperature) >= 1.0
    assert chosen.los.tolist() == [True] * 12 + [False] * 12


def test_a_model_file_gives_back_network_and_card(trained, data, tmp_path):
    path = tmp_path / "m.safetensors"
    digest = save_model(path, trained, {"version": "1", "data": ["x"]})
    network, card = load_model(path)
    assert (card["version"], card["sha256"]) == ("1", digest)
    assert card == read_card(path)
    assert np.array_equal(log_probabilities(network, data.input), log_probabilities(trained.eval(), data.input))


def damaged(path, what):
    if what == "weights":
        tensors = load_file(path)
        card = json.dumps(read_card(path))
        tensors["head.bias"] += 1.0
        save_file(tensors, path, metadata={"model_card": card})
    elif what == "contract":
        card = read_card(path)
        card["input_contract"]["taps"] = 64
        save_file(load_file(path), path, metadata={"model_card": json.dumps(card)})
    elif what == "card":
        save_file(load_file(path), path)
    elif what == "pickle":
        path.write_bytes(pickle.dumps({"weights": [1.0]}))
    elif what == "size":
        path.write_bytes(b"\0" * (5 << 20))
    else:
        path.unlink()


@pytest.mark.parametrize(
    ("what", "told"),
    [
        ("weights", "sha256 does not match"),
        ("contract", "input_contract is not that of this version"),
        ("card", "not a model with a card"),
        ("pickle", "not a model with a card"),
        ("size", "allowed: up to"),
        ("missing", "no such file"),
    ],
)
def test_a_file_that_is_no_model_of_ours_is_refused(trained, tmp_path, what, told):
    path = tmp_path / "m.safetensors"
    save_model(path, trained, {})
    damaged(path, what)
    with pytest.raises(ConfigurationError, match=told):
        load_model(path)


def test_the_shipped_model_is_small_and_says_what_it_is():
    network, card = load_model(shipped_model())
    assert shipped_model().stat().st_size < 300_000
    assert card["data"] == ["uwb_cirs_2018"]
    assert card["placements"] == 27
    assert 0.9 < card["figures"]["balanced_accuracy"] < 1.0
    assert min(network.evidence.with_range[:2]) > 0.0


def test_the_judge_refuses_with_the_reason_and_judges_the_rest_alone():
    classifier, _ = load_classifier(shipped_model(), "cpu")
    frames = pulses([745.0, np.nan, 746.0])
    judged = LinkJudge(classifier).judge(frames, ["a", "a", "b"], [0, 0, 0])
    assert [each.refusal for each in judged] == [Refusal.NOT, Refusal.NO_FIRST_PATH, Refusal.NOT]
    assert [each.method for each in judged] == [Method.NETWORK] * 3
    assert judged[0].los_probability == pytest.approx(sum(judged[0].class_probability[2:]))
    assert judged[0].most_likely_class == 1 + int(np.argmax(judged[0].class_probability))
    assert np.isnan(judged[1].los_probability)
    assert judged[1].most_likely_class == 0
    alone = LinkJudge(classifier).judge(frames.take(slice(2, 3)), ["b"], [0])
    assert alone[0].class_probability == pytest.approx(judged[2].class_probability, abs=1e-5)


@pytest.mark.parametrize("count", [1, 7, 96])
def test_live_use_gives_what_the_network_gives_for_batches_of_any_size(data, count):
    network, _ = load_model(shipped_model())
    some = data.input.take(slice(0, count)).without_range() if count == 7 else data.input.take(slice(0, count))
    wanted = np.exp(log_probabilities(network, some))
    assert load_classifier(shipped_model(), "cpu")[0](some) == pytest.approx(wanted, abs=1e-5)


def test_without_a_model_the_power_rule_judges_and_says_so():
    frames = pulses([745.0, 745.0, 745.0], first_path_power_dbm=np.array([-83.0, -88.0, -95.0]))
    judged = LinkJudge(None).judge(frames, ["a"] * 3, [0, 1, 2])
    assert [each.los_probability for each in judged] == [1.0, 0.5, 0.0]
    assert {each.method for each in judged} == {Method.POWER_RULE}
    assert {each.most_likely_class for each in judged} == {0}


def test_cuda_where_there_is_none_is_refused():
    if torch.cuda.is_available():
        pytest.skip("a CUDA device is there: nothing to refuse")
    with pytest.raises(ConfigurationError, match="cuda is not available here; allowed: cpu"):
        load_classifier(shipped_model(), "cuda")
