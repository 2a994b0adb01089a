"""Receptions with labels, from any recording, and the training set that follows from them."""

from collections import Counter
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.cir_frames import CirFrames
from mine_loc_uwb.cir_input import LosInput, Refusal, los_input, refusals
from mine_loc_uwb.link_history import with_history
from mine_loc_uwb.training_set import TrainingSet

LABELS: dict[str, tuple[int, ...]] = {
    "LOS": (3, 4),
    "NLOS": (1, 2),
    "NDP NLOS": (1,),
    "1": (1,),
    "2": (2,),
    "3": (3,),
    "4": (4,),
}
"""Labels and the classes of papers/README.md they allow. Beside "NDP NLOS" in the same recording "NLOS" means 2."""


@dataclass(frozen=True, slots=True, eq=False)
class LabelledFrames:
    """`n` frames in order of time within a link; arrays (n,) unless stated."""

    frames: CirFrames
    allowed: NDArray[np.bool_]  # (n, 4)
    placement: NDArray[np.int64]
    links: Sequence[Hashable]  # whose history a frame belongs to
    stamp_ns: NDArray[np.int64]

    def take(self, which: NDArray[Any]) -> "LabelledFrames":
        """Only some frames, by numbers."""
        links = [self.links[number] for number in which.tolist()]
        return LabelledFrames(
            self.frames.take(which), self.allowed[which], self.placement[which], links, self.stamp_ns[which]
        )


def allowed_classes(labels: Sequence[str]) -> NDArray[np.bool_]:
    """Classes (n, 4) that labels allow. Raises ConfigurationError for an unknown label."""
    known = set(labels)
    unknown = sorted(known - set(LABELS))
    if unknown:
        raise ConfigurationError(f"label: {unknown[0]!r}; allowed: {', '.join(LABELS)}")
    table = LABELS | ({"NLOS": (2,)} if "NDP NLOS" in known else {})
    rows = {label: [number in table[label] for number in range(1, 5)] for label in known}
    return np.array([rows[label] for label in labels], bool).reshape(-1, 4)


def training_set(parts: Sequence[LabelledFrames]) -> tuple[TrainingSet, Counter[str]]:
    """Input of all frames that can be read, and how many were refused by cause. Placements of parts stay apart."""
    refused: Counter[str] = Counter()
    sets, first = [], 0
    for part in parts:
        reasons = refusals(part.frames)
        refused.update(Refusal(int(reason)).name.lower() for reason in reasons if reason)
        part = part.take(np.flatnonzero(reasons == Refusal.NOT))  # noqa: PLW2901
        if not len(part.frames):
            continue
        given = los_input(part.frames)
        side = with_history(part.links, part.stamp_ns.tolist(), given.side)
        sets.append(TrainingSet(LosInput(given.profile, given.edge, side), part.allowed, part.placement + first))
        first = int(sets[-1].placement.max()) + 1
    if not sets:
        raise ConfigurationError(f"data: no frame can be read ({dict(refused)}); allowed: accumulators with first path")
    return TrainingSet.join(sets), refused
