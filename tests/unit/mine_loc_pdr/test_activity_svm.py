"""The decision function in numpy is that of the machine which scikit-learn trained."""

import subprocess
import sys

import numpy as np
import pytest
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import SVC

from mine_loc_pdr.activity_svm import POLY_DEGREE, POLY_OFFSET, Svm
from mine_loc_pdr.activity_training import KERNELS, Candidate, fit_svm


def clouds(count=200, width=4):
    rng = np.random.default_rng(5)
    turning = rng.random(count) < 0.3
    return rng.normal(0.0, 1.0, (count, width)) * 3.0 + turning[:, None] * 2.5 + 10.0, turning


@pytest.mark.parametrize("kernel", KERNELS)
def test_it_decides_as_scikit_learn_does(kernel):
    features, turning = clouds()
    machine = SVC(C=3.0, kernel=kernel, gamma=0.25, degree=POLY_DEGREE, coef0=POLY_OFFSET, class_weight="balanced")
    theirs = make_pipeline(StandardScaler(), machine).fit(features, turning)
    ours = fit_svm(Candidate("turn", kernel, 3.0), features, turning)
    unseen = np.random.default_rng(6).normal(10.0, 5.0, (500, 4))
    np.testing.assert_allclose(ours.decision(unseen), theirs.decision_function(unseen), rtol=1e-9, atol=1e-9)


def test_the_sum_over_support_vectors_is_that_of_paper_b():
    svm = Svm(
        kernel="rbf",
        gamma=0.5,
        mean=np.array([1.0]),
        scale=np.array([2.0]),
        support=np.array([[0.0], [1.0]]),
        coefficient=np.array([-2.0, 3.0]),
        intercept=0.25,
    )
    z = (4.0 - 1.0) / 2.0
    expected = -2.0 * np.exp(-0.5 * z**2) + 3.0 * np.exp(-0.5 * (z - 1.0) ** 2) + 0.25
    assert svm.decision(np.array([[4.0]])) == pytest.approx([expected])


def test_what_the_node_loads_needs_no_scikit_learn():
    code = "import sys, mine_loc_pdr.activity, mine_loc_pdr.activity_model_file as f; f.load_model(f.shipped_model()); "
    subprocess.run([sys.executable, "-c", code + "assert 'sklearn' not in sys.modules"], check=True)
