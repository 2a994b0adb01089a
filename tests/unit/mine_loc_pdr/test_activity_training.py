"""Training: people are never judged by a machine that saw them, and the simplest of the best is taken."""

import itertools

import numpy as np
import pytest
from activity_samples import window

from mine_loc_pdr import activity_training
from mine_loc_pdr.activity import ActivityKind
from mine_loc_pdr.activity_features import matrix
from mine_loc_pdr.activity_labels import LabelledWindow
from mine_loc_pdr.activity_training import CANDIDATES, Candidate, balanced_accuracy, held_out_decisions, select, train

LINEAR = Candidate("turn", "linear", 1.0)


def labelled(people=6, each=12, seed=0):
    """People who turn by 60 to 150° or not at all, with a swing of their own, and stand once."""
    rng = np.random.default_rng(seed)
    found = []
    for person in range(people):
        for k in range(each):
            turning = k % 2 == 0
            turn_deg = rng.choice([-1, 1]) * rng.uniform(60, 150) if turning else rng.uniform(-8, 8)
            made = window(turn_deg, begin_s=rng.uniform(0.0, 3.0), swing_deg=rng.uniform(1, 4))
            kind = ActivityKind.TURNING if turning else ActivityKind.STRAIGHT
            found.append(LabelledWindow(f"person {person}", "w", k, made, kind))
        still = window(0.0, sd_m_s2=0.02)
        found.append(LabelledWindow(f"person {person}", "w", each, still, ActivityKind.STANDING))
    return found


def moving(windows):
    return [each for each in windows if each.label != ActivityKind.STANDING]


def test_simple_kernels_come_first_and_every_combination_once():
    assert len(set(CANDIDATES)) == len(CANDIDATES)
    assert next(c.kernel for c in CANDIDATES if c.features == "turn") == "linear"


def test_a_person_whose_labels_are_upside_down_is_judged_by_the_others():
    windows = moving(labelled())
    turning = np.array([each.label == ActivityKind.TURNING for each in windows])
    odd = np.array([each.person == "person 0" for each in windows])
    features = matrix("turn", [each.window for each in windows])
    decisions = held_out_decisions(LINEAR, features, turning ^ odd, [each.person for each in windows])
    assert ((decisions[odd] > 0) == turning[odd]).all()


def test_a_trained_model_knows_people_it_never_saw():
    model, chosen = train(labelled())
    for each in labelled(people=4, seed=9):
        assert model.judge(each.window).kind == each.label
    assert chosen.accuracies[chosen.candidate] == max(chosen.accuracies.values())


def test_of_equals_the_first_is_taken():
    chosen = select(moving(labelled()))
    best = max(chosen.accuracies.values())
    assert chosen.candidate == next(c for c in CANDIDATES if chosen.accuracies[c] == best)


def test_windows_without_a_label_teach_nothing():
    windows = labelled()
    confusing = [LabelledWindow("person 7", "w", k, window(90.0), ActivityKind.UNKNOWN) for k in range(50)]
    plain, _ = train(windows)
    beside, _ = train(windows + confusing)
    np.testing.assert_array_equal(plain.svm.support, beside.svm.support)
    assert plain.walking == beside.walking


def test_rare_turns_weigh_as_much_as_frequent_straight_walking():
    rng = np.random.default_rng(3)
    features = np.concatenate([rng.normal(0.0, 1.0, (950, 1)), rng.normal(2.0, 1.0, (50, 1))])
    turning = np.arange(1000) >= 950
    decisions = activity_training.fit_svm(LINEAR, features, turning).decision(features)
    assert (decisions[turning] > 0).mean() == pytest.approx((decisions[~turning] < 0).mean(), abs=0.1)


def test_each_candidate_is_told_of_as_it_is_judged():
    count = itertools.count()
    train(labelled(), lambda: next(count))
    assert next(count) == len(CANDIDATES)


def test_balanced_accuracy_is_the_mean_over_both_kinds():
    truth = np.array([True, True, False, False, False, False])
    assert balanced_accuracy(np.array([True, False, False, False, False, True]), truth) == pytest.approx(0.625)
