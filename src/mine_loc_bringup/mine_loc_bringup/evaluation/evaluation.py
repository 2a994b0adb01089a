"""An evaluation as a whole: everybody's measures, all people together, and what became of the measurements."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np

from mine_loc_bringup.evaluation.measures import Compared, Comparing, Measures, compare, measure
from mine_loc_bringup.evaluation.track import StepCount, Track, Truth

Verdicts = Mapping[str, Mapping[str, Counter[str]]]
Counters = Mapping[str, Mapping[str, float]]


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What is reported, plotted and held against bounds. `notes` say what could not be measured, and why."""

    compared: Sequence[Compared]
    people: Mapping[str, Measures]
    together: Measures
    verdicts: Verdicts
    notes: Sequence[str] = field(default_factory=list)
    counters: Counters = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Of plain types."""
        alignments = {each.person: each.alignment.as_json() for each in self.compared}
        return {
            "together": asdict(self.together),
            "people": {name: asdict(found) | {"alignment": alignments[name]} for name, found in self.people.items()},
            "verdicts": {topic: {s: dict(r) for s, r in found.items()} for topic, found in self.verdicts.items()},
            "diagnostics": {name: dict(found) for name, found in self.counters.items()},
            "notes": list(self.notes),
        }


def evaluate(
    tracks: Mapping[str, Track],
    truths: Mapping[str, Truth],
    steps: Mapping[str, StepCount],
    verdicts: Verdicts,
    span_ns: tuple[int, int],
    comparing: Comparing,
    frame: str = "",
    counters: Counters | None = None,
) -> Evaluation:
    """Compare and measure everybody who has outputs, truth or steps; `frame` is that of the outputs."""
    compared, notes = [], []
    for name in sorted({*tracks, *truths, *steps}):
        track, truth = tracks.get(name, _NOTHING), truths.get(name)
        if truth is None:
            notes.append(f"{name}: no truth, errors are not measured")
        elif not len(track):
            notes.append(f"{name}: no output")
        elif frame and truth.frame != frame and not comparing.rigid:
            notes.append(f"{name}: truth is in {truth.frame!r}, the outputs in {frame!r}: see --align rigid")
        try:
            compared.append(compare(name, track, truth, span_ns, comparing, steps.get(name)))
        except ValueError as error:
            notes.append(f"{name}: {error}")
            compared.append(compare(name, track, None, span_ns, comparing, steps.get(name)))
    people = {each.person: measure([each]) for each in compared}
    return Evaluation(compared, people, measure(compared), verdicts, notes, counters or {})


_NOTHING = Track(
    np.empty(0, np.int64),
    np.empty(0, np.int64),
    np.empty((0, 2)),
    np.empty((0, 2, 2)),
    np.empty(0),
    np.empty(0, np.int64),
)
