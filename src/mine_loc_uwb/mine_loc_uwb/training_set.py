"""Frames to train on, and drawing them so that every placement weighs the same: its frames are near copies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mine_loc_uwb.cir_input import LosInput


@dataclass(frozen=True, slots=True, eq=False)
class TrainingSet:
    """`n` frames with the classes that their labels allow, (n, 4), and their placements, (n,)."""

    input: LosInput  # side features with history
    allowed: NDArray[np.bool_]
    placement: NDArray[np.int64]

    def take(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> "TrainingSet":
        """Only some frames."""
        return TrainingSet(self.input.take(which), self.allowed[which], self.placement[which])

    @property
    def los(self) -> NDArray[np.bool_]:
        """Whether the label says line of sight, (n,)."""
        return np.asarray(self.allowed[:, 2:].any(axis=1))

    @staticmethod
    def join(parts: Sequence["TrainingSet"]) -> "TrainingSet":
        """Put sets together whose placements are numbered apart."""
        columns = [[getattr(part.input, name) for part in parts] for name in ("profile", "edge", "side")]
        given = LosInput(*(np.concatenate(column) for column in columns))
        allowed = np.concatenate([part.allowed for part in parts])
        return TrainingSet(given, allowed, np.concatenate([part.placement for part in parts]))


class Sampler:
    """Draws frames so that LOS and NLOS weigh the same, and all placements of a kind do."""

    def __init__(self, data: TrainingSet, rng: np.random.Generator) -> None:
        self._rng = rng
        self._order = np.argsort(data.placement, kind="stable")
        _, self._start, self._count = np.unique(data.placement[self._order], return_index=True, return_counts=True)
        los = data.los[self._order[self._start]]
        weight = np.where(los, 0.5 / max(los.sum(), 1), 0.5 / max((~los).sum(), 1))
        self._weight = weight / weight.sum()

    @property
    def placements(self) -> int:
        """Number of placements."""
        return len(self._start)

    def draw(self, count: int) -> NDArray[np.int64]:
        """Numbers of `count` frames."""
        place = self._rng.choice(len(self._start), count, p=self._weight)
        return np.asarray(self._order[self._start[place] + (self._rng.random(count) * self._count[place]).astype(int)])


def balanced_weights(los: NDArray[np.bool_], placement: NDArray[np.int64]) -> NDArray[np.float64]:
    """Weights (n,) of sum 1 by which both kinds weigh the same, and the placements of each."""
    _, which, count = np.unique(placement, return_inverse=True, return_counts=True)
    weight = 1.0 / count[which]
    kinds = np.where(los, weight[los].sum() if los.any() else 1.0, weight[~los].sum() if (~los).any() else 1.0)
    return np.asarray(weight / kinds / (weight / kinds).sum())
