"""Training of the activity SVM: kernel, constants and features by cross-validation over people, then all of them.

A window of a person is never judged by a machine that saw another window of the same person, neither where a candidate
is chosen nor where decisions become probabilities.
"""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.linear_model import LogisticRegression
from sklearn.model_selection import GroupKFold
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

from mine_loc_pdr.activity import ActivityKind, ActivityModel, Logistic
from mine_loc_pdr.activity_features import FEATURES, log_vertical_sd, matrix
from mine_loc_pdr.activity_labels import LabelledWindow
from mine_loc_pdr.activity_svm import POLY_DEGREE, POLY_OFFSET, Kernel, Svm

Array = NDArray[np.float64]
FOLDS = 5
Progress = Callable[[], None]


@dataclass(frozen=True, slots=True)
class Candidate:
    """One way to make the machine; the kernel's gamma is 1 / number of features."""

    features: str
    kernel: Kernel
    cost: float


KERNELS: tuple[Kernel, ...] = ("linear", "poly", "rbf")  # simplest first: of equals the first is taken
CANDIDATES = tuple(Candidate(*each) for each in itertools.product(FEATURES, KERNELS, (0.1, 1.0, 10.0, 100.0)))


@dataclass(frozen=True, slots=True, eq=False)
class Selection:
    """The chosen candidate, balanced accuracies of all by cross-validation, and the chosen one's held-out decisions."""

    candidate: Candidate
    accuracies: dict[Candidate, float]
    decisions: Array  # (n,) of the straight and turning windows, in their order
    turning: NDArray[np.bool_]  # (n,)


def train(windows: Sequence[LabelledWindow], progress: Progress | None = None) -> tuple[ActivityModel, Selection]:
    """Choose a candidate and fit it to all windows whose label is known; `progress` is called once a candidate."""
    moving = [each for each in windows if each.label in {ActivityKind.STRAIGHT, ActivityKind.TURNING}]
    chosen = select(moving, progress)
    features = matrix(chosen.candidate.features, [each.window for each in moving])
    model = ActivityModel(
        chosen.candidate.features,
        fit_svm(chosen.candidate, features, chosen.turning),
        fit_walking(windows),
        _logistic(chosen.decisions, chosen.turning),
    )
    return model, chosen


def select(moving: Sequence[LabelledWindow], progress: Progress | None = None) -> Selection:
    """Judge every candidate on people it was not fitted to and take the first of the best."""
    people = [each.person for each in moving]
    turning = np.array([each.label == ActivityKind.TURNING for each in moving])
    table = {name: matrix(name, [each.window for each in moving]) for name in FEATURES}
    accuracies: dict[Candidate, float] = {}
    best: tuple[float, Candidate, Array] | None = None
    for candidate in CANDIDATES:
        decisions = held_out_decisions(candidate, table[candidate.features], turning, people)
        accuracies[candidate] = balanced_accuracy(decisions > 0.0, turning)
        if best is None or accuracies[candidate] > best[0]:
            best = accuracies[candidate], candidate, decisions
        if progress is not None:
            progress()
    assert best is not None
    return Selection(best[1], accuracies, best[2], turning)


def held_out_decisions(
    candidate: Candidate, features: Array, turning: NDArray[np.bool_], people: Sequence[str]
) -> Array:
    """Decisions (n,) on features (n, d), each by a machine fitted to the windows of other people."""
    decisions = np.empty(len(features))
    for fitted, held_out in GroupKFold(FOLDS).split(features, turning, people):
        decisions[held_out] = fit_svm(candidate, features[fitted], turning[fitted]).decision(features[held_out])
    return decisions


def fit_svm(candidate: Candidate, features: Array, turning: NDArray[np.bool_]) -> Svm:
    """Fit to features (n, d) and labels (n,), both kinds weighing the same however many windows they have."""
    scaler = StandardScaler().fit(features)
    gamma = 1.0 / features.shape[1]
    machine = SVC(
        C=candidate.cost,
        kernel=candidate.kernel,
        gamma=gamma,
        degree=POLY_DEGREE,
        coef0=POLY_OFFSET,
        class_weight="balanced",
    ).fit(scaler.transform(features), turning)
    return Svm(
        candidate.kernel,
        gamma,
        np.asarray(scaler.mean_),
        np.asarray(scaler.scale_),
        np.asarray(machine.support_vectors_),
        np.asarray(machine.dual_coef_[0]),
        float(machine.intercept_[0]),
    )


def fit_walking(windows: Sequence[LabelledWindow]) -> Logistic:
    """Standing against straight or turning."""
    known = [each for each in windows if each.label != ActivityKind.UNKNOWN]
    briskness = np.array([log_vertical_sd(each.window) for each in known])
    return _logistic(briskness, np.array([each.label != ActivityKind.STANDING for each in known]))


def balanced_accuracy(judged: NDArray[np.bool_], truth: NDArray[np.bool_]) -> float:
    """Mean of the shares that are right of what is true and of what is not."""
    return 0.5 * (float(judged[truth].mean()) + float((~judged[~truth]).mean()))


def _logistic(values: Array, truth: NDArray[np.bool_]) -> Logistic:
    fitted = LogisticRegression(class_weight="balanced").fit(values[:, None], truth)
    return Logistic(float(fitted.coef_[0, 0]), float(fitted.intercept_[0]))
