"""LOS or NLOS of every reception whose accumulator came with it."""

import itertools
import os
import sys
from collections import Counter, deque
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from mine_loc_interfaces.msg import CirFrame, CirFrameArray, LinkState, LinkStateArray, LosModelInfo

from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.node_base import Host, NodeBase, Worker
from mine_loc_core.nodes.qos import EVENTS, LATCHED
from mine_loc_core.nodes.ros_host import run
from mine_loc_core.stamps import to_stamp_ns
from mine_loc_uwb.cir_input import Refusal
from mine_loc_uwb.link_judgement import Classifier, LinkJudge, load_classifier
from mine_loc_uwb.nodes.cir_messages import tap_count, to_cir_frames, to_link_state
from mine_loc_uwb.parameters import LosClassifierParameters

_MOST_WAITING = 256
"""Rounds that wait for judgement; the oldest are given up beyond."""


@dataclass(frozen=True, slots=True)
class _Model:
    """What loading gave: a classifier and its card, or None and why."""

    classifier: Classifier | None
    card: dict
    problem: str = ""


class LosClassifier(NodeBase):
    """Judges what has arrived, as one batch; by the power rule if no model can be had."""

    default_name = "los_classifier"
    parameter_class = LosClassifierParameters

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._worker: Worker | None = None

    def configure(self) -> None:
        """Begin to load the model, in the thread that is going to judge. Frames wait until it is there."""
        if self._worker is not None:
            self._worker.end()
        self._model: _Model | None = None
        self._waiting: deque[CirFrameArray] = deque(maxlen=_MOST_WAITING)
        self._judged = 0
        self._refused: Counter[str] = Counter()
        self._states = self.publish_to(LinkStateArray, "uwb/link_state", EVENTS)
        self._info = self.publish_to(LosModelInfo, "~/model_info", LATCHED)
        # torch takes seconds to import, in which the node must answer and be able to stop
        self._worker = self.host.make_worker(self._load, self.guarded(self._judge, "judgement"))
        self.subscribe(CirFrameArray, "uwb/cir", self._on_round, EVENTS)

    def activate(self) -> None:
        """Take up what came while the node was inactive."""
        if self._model is not None:
            self._announce(self._model)
        self._worker.wake()

    def clock_jumped(self, delta_ns: int) -> None:  # noqa: ARG002
        """Histories before and after do not belong together."""
        if self._model is not None:
            self._links.forget()

    def health(self) -> Iterable[Health]:
        """The model in use, frames judged, and refused by cause."""
        figures = {"judged": self._judged} | dict(self._refused)
        if self._model is None:
            yield Health("model", Level.OK, "loading", figures)
        elif self._model.problem:
            yield Health("model", Level.WARN, f"power rule: {self._model.problem}", figures)
        else:
            yield Health("model", Level.OK, str(self._model.card.get("version", "")), figures)

    def _load(self) -> None:
        path = Path(self.parameters.model) if self.parameters.model else _shipped_model()
        try:
            model = _Model(*load_classifier(path, self.parameters.device))
        except Exception as error:  # noqa: BLE001 whatever is wrong with it, the power rule serves
            model = _Model(None, {}, str(error) or repr(error))
            self.host.warn(f"no model, the power rule serves: {model.problem}")
        self._links = LinkJudge(model.classifier)
        self._model = model
        if self.active:  # otherwise `activate` does
            self._announce(model)

    def _announce(self, model: _Model) -> None:
        info = LosModelInfo(
            model_version=str(model.card.get("version", "power rule")),
            model_sha256=str(model.card.get("sha256", "")),
            training_data=", ".join(map(str, model.card.get("data", []))),
            balanced_accuracy=float(model.card.get("figures", {}).get("balanced_accuracy", float("nan"))),
        )
        info.header.stamp = to_time(self.now_ns())
        self._info.publish(info)

    def _on_round(self, array: CirFrameArray) -> None:
        if len(self._waiting) == _MOST_WAITING:
            self._refused["overflow"] += len(self._waiting[0].frames)
        self._waiting.append(array)
        self._worker.wake()

    def _judge(self) -> None:
        waiting = [self._waiting.popleft() for _ in range(len(self._waiting))]
        frames = [frame for array in waiting for frame in array.frames]
        states = itertools.chain.from_iterable(
            self._judge_batch(list(group)) for _, group in itertools.groupby(frames, tap_count)
        )
        for array in waiting:
            of_round = list(itertools.islice(states, len(array.frames)))
            self._states.publish(LinkStateArray(header=array.header, states=of_round))

    def _judge_batch(self, frames: list[CirFrame]) -> list[LinkState]:
        links = [(frame.tag_id, frame.anchor_id) for frame in frames]
        stamps_ns = [to_stamp_ns(frame.header.stamp) for frame in frames]
        judgements = self._links.judge(to_cir_frames(frames), links, stamps_ns)
        for judged in judgements:
            if judged.refusal is Refusal.NOT:
                self._judged += 1
            else:
                self._refused[judged.refusal.name.lower()] += 1
        return [to_link_state(frame, judged) for frame, judged in zip(frames, judgements, strict=True)]


def _shipped_model() -> Path:
    return Path(__file__).parents[1] / "models" / "los.safetensors"


def main() -> NoReturn:
    """Entry point."""
    status = run(LosClassifier)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)  # unloading torch takes longer than a node has to end


if __name__ == "__main__":
    main()
