"""Weights of the LOS network as a file: safetensors, nothing in it is executed, with a model card in its header.

The card names data, protocol, figures and date, the input contract the network was trained to, and the SHA-256 of the
weights. A file whose contract or hash is not ours is refused.
"""

import hashlib
import json
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb import cir_input, link_history
from mine_loc_uwb.los_network import LosNetwork

_MOST_BYTES = 4 << 20
_CARD = "model_card"

INPUT_CONTRACT: dict[str, Any] = {
    "taps_before_first_path": cir_input.BEFORE,
    "taps": cir_input.TAPS,
    "profiles": ["magnitude / peak", "log10(magnitude / noise) / 2"],
    "edge": [cir_input.EDGE_TAPS, cir_input.EDGE_PER_TAP],
    "side": list(cir_input.SIDE_NAMES),
    "history_frames": link_history.DEPTH,
}
"""What the input stage of this version gives; a network fits it or is not loaded."""


def shipped_model() -> Path:
    """Path of the model that comes with the package."""
    return Path(__file__).parent / "models" / "los.safetensors"


def save_model(path: Path, network: LosNetwork, card: dict[str, Any]) -> str:
    """Write weights and card; contract and hash are added to the card. Returns the SHA-256 of the weights."""
    tensors = {name: value.contiguous() for name, value in network.state_dict().items()}
    digest = _digest(tensors)
    full = card | {"input_contract": INPUT_CONTRACT, "sha256": digest}
    path.parent.mkdir(parents=True, exist_ok=True)
    save_file(tensors, path, metadata={_CARD: json.dumps(full, sort_keys=True)})
    return digest


def read_card(path: Path) -> dict[str, Any]:
    """Read the model card alone. Raises ConfigurationError like `load_model`."""
    return _read(path)[1]


def load_model(path: Path) -> tuple[LosNetwork, dict[str, Any]]:
    """Read network (in evaluation mode) and card.

    Raises ConfigurationError for a file that is missing, too large, no safetensors, without a card, made for another
    input or damaged.
    """
    tensors, card = _read(path)
    if card.get("input_contract") != INPUT_CONTRACT:
        raise ConfigurationError(f"{path}: input_contract is not that of this version; allowed: a model trained by it")
    if card.get("sha256") != _digest(tensors):
        raise ConfigurationError(f"{path}: sha256 does not match the weights; allowed: an undamaged file")
    network = LosNetwork()
    try:
        network.load_state_dict(tensors)
    except RuntimeError as error:
        raise ConfigurationError(f"{path}: weights do not fit the network: {error}") from None
    return network.eval(), card


def _read(path: Path) -> tuple[dict[str, torch.Tensor], dict[str, Any]]:
    if not path.is_file():
        raise ConfigurationError(f"{path}: no such file; allowed: a model written by mine-loc train-los")
    if path.stat().st_size > _MOST_BYTES:
        raise ConfigurationError(f"{path}: {path.stat().st_size} bytes; allowed: up to {_MOST_BYTES}")
    try:
        with safe_open(path, framework="pt") as file:
            card = json.loads((file.metadata() or {})[_CARD])
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 not a dictionary
    except (SafetensorError, KeyError, ValueError) as error:
        raise ConfigurationError(f"{path}: not a model with a card ({error}); allowed: safetensors") from None
    if not isinstance(card, dict):
        raise ConfigurationError(f"{path}: {_CARD} is no object; allowed: one written by mine-loc train-los")
    return tensors, card


def _digest(tensors: dict[str, torch.Tensor]) -> str:
    total = hashlib.sha256()
    for name in sorted(tensors):
        total.update(name.encode())
        total.update(tensors[name].contiguous().numpy().tobytes())
    return total.hexdigest()
