"""Judging receptions live: refusals, history, network; or the power rule where no network can be had."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from math import nan
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mine_loc_uwb.cir_frames import CirFrames
from mine_loc_uwb.cir_input import LosInput, Refusal, los_input, refusals
from mine_loc_uwb.link_history import LinkHistory
from mine_loc_uwb.ranging import DW1000_MAX_TAPS
from mine_loc_uwb.received_power import los_probability_from_powers


class Method(IntEnum):
    """How a link was judged; the numbers of mine_loc_interfaces/LinkState."""

    UNKNOWN = 0
    NETWORK = 1
    POWER_RULE = 2


@dataclass(frozen=True, slots=True)
class Judgement:
    """Of one reception. Probabilities are NaN where it was not judged, those of classes also by the power rule."""

    method: Method
    refusal: Refusal = Refusal.NOT
    los_probability: float = nan
    class_probability: tuple[float, ...] = field(default=(nan,) * 4)

    @property
    def most_likely_class(self) -> int:
        """Class 1 to 4, 0 = unknown."""
        known = self.class_probability[0] == self.class_probability[0]
        return int(np.argmax(self.class_probability)) + 1 if known else 0


class Classifier(Protocol):
    """Anything that gives class probabilities (n, 4) for an input with history."""

    def __call__(self, given: LosInput) -> NDArray[np.float64]:
        """Probabilities of classes 1 to 4."""


class LinkJudge:
    """Keeps the history of links. `classifier` None: the power rule alone."""

    def __init__(self, classifier: Classifier | None) -> None:
        self._classifier = classifier
        self._history = LinkHistory()
        self.judge(_made_up(), [None], [0])  # compiles what the first round would wait for
        self.forget()

    def forget(self) -> None:
        """Begin all histories anew."""
        self._history = LinkHistory()

    def judge(self, frames: CirFrames, links: Sequence[Hashable], stamps_ns: Sequence[int]) -> list[Judgement]:
        """Judge `n` frames of one width in order of arrival; links and stamps (n,) tell which history is theirs."""
        if self._classifier is None:
            return [_by_powers(*row) for row in zip(frames.first_path_power_dbm, frames.receive_power_dbm, strict=True)]
        refused = refusals(frames)
        fit = np.flatnonzero(refused == Refusal.NOT)
        judged = {
            number: Judgement(Method.NETWORK, Refusal(int(refused[number])))
            for number in np.flatnonzero(refused != Refusal.NOT).tolist()
        }
        if not len(fit):
            return [judged[number] for number in range(len(frames))]
        seen = los_input(frames if len(fit) == len(frames) else frames.take(fit))
        rows = zip(fit.tolist(), seen.side, strict=True)
        side = np.stack([self._history.extend(links[number], stamps_ns[number], row) for number, row in rows])
        probability = self._classifier(LosInput(seen.profile, seen.edge, side))
        for number, row in zip(fit.tolist(), probability.tolist(), strict=True):
            judged[number] = Judgement(Method.NETWORK, Refusal.NOT, row[2] + row[3], tuple(row))
        return [judged[number] for number in range(len(frames))]


def _made_up() -> CirFrames:
    samples, one = np.zeros((1, DW1000_MAX_TAPS, 2), np.int16), np.ones(1)
    samples[0, 745] = 1000
    return CirFrames(samples, np.zeros(1, np.int64), 745.0 * one, one, one, one, one, one, np.full(1, 5))


def _by_powers(first_path_dbm: float, receive_dbm: float) -> Judgement:
    return Judgement(Method.POWER_RULE, los_probability=los_probability_from_powers(first_path_dbm, receive_dbm))


def load_classifier(path: Path, device: str) -> tuple[Classifier, dict[str, Any]]:
    """Read a model for live use on "cpu" (compiled, one thread) or "cuda" (torch); returns it and its card.

    torch is imported here, so that nodes without a model do not pay for it. Raises ConfigurationError for a file that
    is no model and for "cuda" where there is none, ImportError without torch or safetensors.
    """
    from mine_loc_uwb.los_model_file import load_model  # noqa: PLC0415

    network, card = load_model(path)
    if device == "cpu":
        from mine_loc_uwb.los_kernel import KernelClassifier, weights_of  # noqa: PLC0415

        return KernelClassifier(weights_of(network.state_dict())), card
    from mine_loc_uwb.los_inference import TorchClassifier  # noqa: PLC0415

    return TorchClassifier(network, device), card
