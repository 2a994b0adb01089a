"""The demonstration's report: the measures of `mine-loc evaluate`, and the gaps."""

import functools
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from mine_loc_bringup.demo.playback import Truth
from mine_loc_bringup.evaluation import track as evaluated
from mine_loc_bringup.evaluation.measures import Compared, Comparing, compare, measure
from mine_loc_bringup.evaluation.track import Track
from mine_loc_core.stamps import NS_PER_S, to_ns

Array = npt.NDArray[np.float64]

_GAP_S = 0.5


@dataclass(frozen=True, slots=True)
class PersonReport:
    """One person's figures, and the comparison they come from, for the plot."""

    name: str
    figures: Mapping[str, object]
    compared: Compared


def person_report(name: str, track: Track, truth: Truth, started_ns: int, end_s: float) -> PersonReport:
    """Score a track of a recording that was played from `started_ns` on for `end_s`.

    Raises ValueError when nothing was published or truth covers too little of it.
    """
    if not len(track):
        raise ValueError(f"{name}: no output was received")
    own = not truth.shared_clock_and_frame
    stamps_ns = started_ns + np.round(truth.times_s * NS_PER_S).astype(np.int64)
    known = evaluated.Truth(stamps_ns, truth.positions_m[:, :2])
    due_ns = (started_ns, started_ns + to_ns(end_s))
    compared = compare(name, track, known, due_ns, Comparing(rigid=own, apply_time_offset=own))
    gaps = [(a, b - a) for a, b in itertools.pairwise(compared.logged_s) if b - a > _GAP_S]
    figures = asdict(measure([compared])) | {
        "gaps_over_half_a_second": [{"at_s": round(float(a), 2), "length_s": round(float(b), 2)} for a, b in gaps],
        "alignment": compared.alignment.as_json(),
    }
    return PersonReport(name, figures, compared)


def together(reports: Sequence[PersonReport]) -> dict[str, object]:
    """All people as one."""
    return asdict(measure([report.compared for report in reports]))


def plot(reports: Sequence[PersonReport], anchors_m: Array, title: str, file: Path) -> None:
    """Tracks over truth, and the error over time with the claimed 95 % circle."""
    from mine_loc_bringup.evaluation.plots import draw_error_over_time, draw_tracks, save_figure  # noqa: PLC0415 slow

    compared = [report.compared for report in reports]

    def plan(axes: Any) -> None:
        axes.plot(*anchors_m.T[:2], "k^", label="anchors")
        draw_tracks(axes, compared)

    save_figure([plan, functools.partial(draw_error_over_time, compared=compared)], title, file)
