"""The step model as a file; its card says for which network and frames it is."""

from pathlib import Path
from typing import Any

import numpy as np

from mine_loc_core.errors import ConfigurationError
from mine_loc_pdr.model_file import numbers, read_model, write_model
from mine_loc_pdr.step_detector import LOOKAHEAD_S, StepModel
from mine_loc_pdr.step_frames import CHANNELS, FRAME_NS
from mine_loc_pdr.step_kernel import DILATIONS, SCALE, TAPS, WEIGHTS, WIDTH

INPUT_CONTRACT: dict[str, Any] = {
    "frame_ns": FRAME_NS,
    "channels": CHANNELS,
    "scale": SCALE.tolist(),
    "width": WIDTH,
    "taps": TAPS,
    "dilations": list(DILATIONS),
    "lookahead_s": LOOKAHEAD_S,
}
"""The network of this version and what it takes; a model fits it or is not loaded."""


def shipped_step_model() -> Path:
    """Path of the model that comes with the package."""
    return Path(__file__).parent / "models" / "steps.npz"


def save_step_model(path: Path, model: StepModel, card: dict[str, Any]) -> None:
    """Write numbers and card; the contract is added to the card."""
    arrays = {"weights": model.weights, "threshold": np.array(model.threshold)}
    write_model(path, arrays, card | {"input_contract": INPUT_CONTRACT})


def load_step_model(path: Path) -> tuple[StepModel, dict[str, Any]]:
    """Read model and card.

    Raises ConfigurationError for a file that is missing, too large, no npz, without a card, made for another network
    or of numbers that do not fit it.
    """
    arrays, card = read_model(path, INPUT_CONTRACT, "mine-loc train-steps")
    threshold = float(numbers(path, arrays, "threshold", ()))
    if not 0.0 < threshold < 1.0:
        raise ConfigurationError(f"{path}: threshold {threshold}; allowed: a probability between 0 and 1")
    return StepModel(numbers(path, arrays, "weights", (WEIGHTS,), np.float32), threshold), card
