"""What the demonstration plays: bytes for serial lines, and the truth to report against."""

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.people import Person
from mine_loc_sim.timed_bytes import Arrival

Array = npt.NDArray[np.float64]
DATA_VARIABLE = "MINE_LOC_DATA"


@dataclass(frozen=True, slots=True)
class Truth:
    """Positions (n, 3) [m] of one person at increasing `times_s` of the truth's own clock, in the truth's own frame."""

    person: str
    times_s: Array
    positions_m: Array
    shared_clock_and_frame: bool = False
    """Simulated truth needs no alignment; it is reported without."""


@dataclass(frozen=True, slots=True)
class Recording:
    """A recording ready to be played, once.

    `site` names the folder under config/ that describes the place, or is a path of its own; `lines` maps `receiver` or
    `person/n100` to what arrives over that serial line, in order of time from 0 to `lasts_s`. `people` are those who
    take part where not all of the site's do.
    """

    source: str
    site: str
    lines: Mapping[str, Iterable[Arrival]]
    lasts_s: float
    truths: Sequence[Truth]
    people: Sequence[Person] | None = None


def data_file(*parts: str) -> Path:
    """A file of the public recordings. Raises ConfigurationError when they are not here."""
    folder = os.environ.get(DATA_VARIABLE, "")
    path = Path(folder, *parts)
    if not folder or not path.exists():
        raise ConfigurationError(
            f"{DATA_VARIABLE}={folder!r}: {Path(*parts)} is not there; allowed: the folder of public recordings"
        )
    return path
