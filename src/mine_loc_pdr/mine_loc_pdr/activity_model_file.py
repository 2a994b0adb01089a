"""The activity model as a file: an npz of numbers without pickle, nothing in it is executed, with a card as JSON.

The card says what the model was trained on and how it scored, which features and kernel it takes, and for which window.
A file made for another window or other features, or whose numbers are not of the shapes that belong together, is
refused.
"""

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.errors import ConfigurationError
from mine_loc_pdr.activity import ActivityModel, Logistic
from mine_loc_pdr.activity_features import FEATURES, SMOOTHED_BINS, width
from mine_loc_pdr.activity_svm import POLY_DEGREE, POLY_OFFSET, Svm
from mine_loc_pdr.activity_window import BIN_NS, BINS

MOST_BYTES = 200_000
_CARD = "card"
_KERNELS = ("linear", "poly", "rbf")
Array = NDArray[np.float64]

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
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        np.savez(
            file,
            card=np.array(json.dumps(full, sort_keys=True)),
            mean=svm.mean,
            scale=svm.scale,
            support=svm.support,
            coefficient=svm.coefficient,
            intercept=np.array(svm.intercept),
            gamma=np.array(svm.gamma),
            walking=np.array([model.walking.slope, model.walking.intercept]),
            turning=np.array([model.turning.slope, model.turning.intercept]),
        )


def load_model(path: Path) -> tuple[ActivityModel, dict[str, Any]]:
    """Read model and card.

    Raises ConfigurationError for a file that is missing, too large, no npz, without a card, made for another window or
    of numbers that do not fit together.
    """
    arrays, card = _read(path)
    if card.get("input_contract") != INPUT_CONTRACT:
        raise ConfigurationError(f"{path}: input_contract is not that of this version; allowed: a model trained by it")
    features, kernel = str(card.get("features")), card.get("kernel")
    if features not in FEATURES or kernel not in _KERNELS:
        raise ConfigurationError(
            f"{path}: features {features}, kernel {kernel}; allowed: {', '.join(FEATURES)}; {', '.join(_KERNELS)}"
        )
    support = _numbers(path, arrays, "support", (-1, width(features)))
    mean, scale = (_numbers(path, arrays, name, support.shape[1:]) for name in ("mean", "scale"))
    if not (scale > 0.0).all():
        raise ConfigurationError(f"{path}: scale {scale.min()}; allowed: above 0")
    svm = Svm(
        kernel,
        float(_numbers(path, arrays, "gamma", ())),
        mean,
        scale,
        support,
        _numbers(path, arrays, "coefficient", support.shape[:1]),
        float(_numbers(path, arrays, "intercept", ())),
    )
    walking, turning = (Logistic(*_numbers(path, arrays, name, (2,)).tolist()) for name in ("walking", "turning"))
    return ActivityModel(features, svm, walking, turning), card


def _read(path: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    if not path.is_file():
        raise ConfigurationError(f"{path}: no such file; allowed: a model written by mine-loc train-activity")
    try:
        with zipfile.ZipFile(path) as archive:
            size = max(path.stat().st_size, sum(member.file_size for member in archive.infolist()))
        if size > MOST_BYTES:
            raise ConfigurationError(f"{path}: {size} bytes; allowed: up to {MOST_BYTES}")
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        card = json.loads(str(arrays.pop(_CARD)))
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise ConfigurationError(f"{path}: not a model with a card ({error}); allowed: npz without pickle") from None
    if not isinstance(card, dict):
        raise ConfigurationError(f"{path}: {_CARD} is no object; allowed: one written by mine-loc train-activity")
    return arrays, card


def _numbers(path: Path, arrays: dict[str, NDArray[Any]], name: str, shape: tuple[int, ...]) -> Array:
    """An array of finite numbers of this shape, −1 being any length."""
    array = arrays.get(name)
    fits = array is not None and array.dtype == np.float64 and array.ndim == len(shape)
    if array is None or not fits or any(s not in {-1, n} for s, n in zip(shape, array.shape, strict=True)):
        found = "missing" if array is None else f"{array.dtype} {array.shape}"
        raise ConfigurationError(f"{path}: {name} is {found}; allowed: float64 {shape}, -1 being any length")
    if not np.isfinite(array).all():
        raise ConfigurationError(f"{path}: {name} is not finite; allowed: finite numbers")
    return array
