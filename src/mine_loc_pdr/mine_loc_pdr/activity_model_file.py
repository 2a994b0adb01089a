"""The activity model as a file; its card says which features and kernel it takes, and for which window.

A file made for another window or other features, or whose numbers are not of the shapes that belong together, is
refused.
"""

from pathlib import Path
from typing import Any

import numpy as np

from mine_loc_core.errors import ConfigurationError
from mine_loc_pdr.activity import ActivityModel, Logistic
from mine_loc_pdr.activity_features import FEATURES, SMOOTHED_BINS, width
from mine_loc_pdr.activity_svm import POLY_DEGREE, POLY_OFFSET, Svm
from mine_loc_pdr.activity_window import BIN_NS, BINS
from mine_loc_pdr.model_file import numbers, read_model, write_model

_KERNELS = ("linear", "poly", "rbf")

INPUT_CONTRACT: dict[str, Any] = {
    "bins": BINS,
    "bin_ns": BIN_NS,
    "smoothed_bins": SMOOTHED_BINS,
    "poly": [POLY_DEGREE, POLY_OFFSET],
}
"""What the features of this version are made of; a model fits it or is not loaded."""


def shipped_model() -> Path:
    """Path of the model that comes with the package."""
    return Path(__file__).parent / "models" / "activity.npz"


def save_model(path: Path, model: ActivityModel, card: dict[str, Any]) -> None:
    """Write numbers and card; what names features, kernel and contract is added to the card."""
    svm = model.svm
    full = card | {"features": model.features, "kernel": svm.kernel, "input_contract": INPUT_CONTRACT}
    arrays = {
        "mean": svm.mean,
        "scale": svm.scale,
        "support": svm.support,
        "coefficient": svm.coefficient,
        "intercept": np.array(svm.intercept),
        "gamma": np.array(svm.gamma),
        "walking": np.array([model.walking.slope, model.walking.intercept]),
        "turning": np.array([model.turning.slope, model.turning.intercept]),
    }
    write_model(path, arrays, full)


def load_model(path: Path) -> tuple[ActivityModel, dict[str, Any]]:
    """Read model and card.

    Raises ConfigurationError for a file that is missing, too large, no npz, without a card, made for another window or
    of numbers that do not fit together.
    """
    arrays, card = read_model(path, INPUT_CONTRACT, "mine-loc train-activity")
    features, kernel = str(card.get("features")), card.get("kernel")
    if features not in FEATURES or kernel not in _KERNELS:
        raise ConfigurationError(
            f"{path}: features {features}, kernel {kernel}; allowed: {', '.join(FEATURES)}; {', '.join(_KERNELS)}"
        )
    support = numbers(path, arrays, "support", (-1, width(features)))
    mean, scale = (numbers(path, arrays, name, support.shape[1:]) for name in ("mean", "scale"))
    if not (scale > 0.0).all():
        raise ConfigurationError(f"{path}: scale {scale.min()}; allowed: above 0")
    svm = Svm(
        kernel,
        float(numbers(path, arrays, "gamma", ())),
        mean,
        scale,
        support,
        numbers(path, arrays, "coefficient", support.shape[:1]),
        float(numbers(path, arrays, "intercept", ())),
    )
    walking, turning = (Logistic(*numbers(path, arrays, name, (2,)).tolist()) for name in ("walking", "turning"))
    return ActivityModel(features, svm, walking, turning), card
