"""What the demonstration plays: bytes for serial lines, and the truth to report against."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mine_loc_core.people import Person
from mine_loc_sim.timed_bytes import Arrival

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Truth:
    """Positions (n, 3) [m] of one person at increasing `times_s` of the truth's own clock, in the truth's own frame."""

    person: str
    times_s: Array
    positions_m: Array
    shared_clock_and_frame: bool = False
    """Simulated truth needs no alignment; it is reported without."""


@dataclass(frozen=True, slots=True)
class Playback:
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
