"""A model as a file: an npz of numbers without pickle, nothing in it is executed, with a card as JSON.

The card says what the model was trained on, how it scored and what it takes (`input_contract`).
"""

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.errors import ConfigurationError

MOST_BYTES = 200_000
_CARD = "card"


def write_model(path: Path, arrays: dict[str, NDArray[Any]], card: dict[str, Any]) -> None:
    """Write numbers and card."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays, **{_CARD: np.array(json.dumps(card, sort_keys=True))})


def read_model(path: Path, contract: dict[str, Any], writer: str) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Numbers and card of a file that `writer`, a command, wrote.

    Raises ConfigurationError for a file that is missing, too large, no npz, without a card or of another contract.
    """
    arrays, card = _read(path, writer)
    if card.get("input_contract") != contract:
        raise ConfigurationError(f"{path}: input_contract is not that of this version; allowed: a model trained by it")
    return arrays, card


def _read(path: Path, writer: str) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    if not path.is_file():
        raise ConfigurationError(f"{path}: no such file; allowed: a model written by {writer}")
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
        raise ConfigurationError(f"{path}: {_CARD} is no object; allowed: one written by {writer}")
    return arrays, card


def numbers(
    path: Path, arrays: dict[str, NDArray[Any]], name: str, shape: tuple[int, ...], dtype: type = np.float64
) -> NDArray[Any]:
    """An array of finite numbers of this shape, −1 being any length; raises ConfigurationError for any other."""
    array = arrays.get(name)
    fits = array is not None and array.dtype == dtype and array.ndim == len(shape)
    if array is None or not fits or any(s not in {-1, n} for s, n in zip(shape, array.shape, strict=True)):
        found = "missing" if array is None else f"{array.dtype} {array.shape}"
        raise ConfigurationError(f"{path}: {name} is {found}; allowed: {np.dtype(dtype)} {shape}, -1 being any length")
    if not np.isfinite(array).all():
        raise ConfigurationError(f"{path}: {name} is not finite; allowed: finite numbers")
    return array
