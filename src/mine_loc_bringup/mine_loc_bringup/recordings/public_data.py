"""Where the public recordings lie: the folder that MINE_LOC_DATA names, and what is said when a file is not there."""

import os
from pathlib import Path

from mine_loc_core.errors import ConfigurationError

DATA_VARIABLE = "MINE_LOC_DATA"


def data_file(*parts: str) -> Path:
    """A file of the public recordings. Raises ConfigurationError when they are not here."""
    folder = os.environ.get(DATA_VARIABLE, "")
    path = Path(folder, *parts)
    if not folder or not path.exists():
        raise ConfigurationError(
            f"{DATA_VARIABLE}={folder!r}: {Path(*parts)} is not there; allowed: the folder of public recordings"
        )
    return path


def refused(path: Path, problem: object, expected: str) -> ConfigurationError:
    """The error for a file that cannot be read: names it, what is wrong and what is expected."""
    return ConfigurationError(f"{path}: {problem}; allowed: {expected}")


def required(path: Path, expected: str) -> Path:
    """The path, or ConfigurationError if nothing is there."""
    if not path.exists():
        raise refused(path, "is not there", expected)
    return path
