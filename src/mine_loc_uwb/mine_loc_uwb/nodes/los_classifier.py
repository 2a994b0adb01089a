"""LOS or NLOS of every reception whose accumulator came with it."""

import sys
from collections import Counter, deque
from collections.abc import Iterable
from itertools import groupby
from pathlib import Path

from mine_loc_interfaces.msg import CirFrame, LinkState, LosModelInfo

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.conversions import to_stamp_ns
from mine_loc_core.nodes.node_base import NodeBase, run
from mine_loc_core.nodes.qos import EVENTS, LATCHED
from mine_loc_uwb.cir_input import Refusal
from mine_loc_uwb.link_judgement import Classifier, LinkJudge, load_classifier
from mine_loc_uwb.nodes.cir_messages import tap_count, to_cir_frames, to_link_state
from mine_loc_uwb.parameters import LosClassifierParameters

_MOST_WAITING = 1024
"""Frames that wait for judgement; the oldest are given up beyond."""


class LosClassifier(NodeBase):
    """Judges what has arrived, as one batch; by the power rule if no model can be had."""

    parameter_class = LosClassifierParameters
    needs_guard_condition = True

    def __init__(self) -> None:
        super().__init__("los_classifier")
        self._arrived = self.create_guard_condition(self.guarded(self._judge, "judgement"))

    def configure(self) -> None:
        """Load the model; without one the power rule serves and the diagnostics say why."""
        self._card: dict = {}
        self._problem = ""
        self._judge_of = LinkJudge(self._load())
        self._waiting: deque[CirFrame] = deque(maxlen=_MOST_WAITING)
        self._judged = 0
        self._refused: Counter[str] = Counter()
        self._states = self.publish_to(LinkState, "uwb/link_state", EVENTS)
        self._info = self.publish_to(LosModelInfo, "~/model_info", LATCHED)
        self.subscribe(CirFrame, "uwb/cir", self._on_frame, EVENTS)

    def activate(self) -> None:
        """Say which model is in use."""
        figures = self._card.get("figures", {})
        info = LosModelInfo(
            model_version=str(self._card.get("version", "power rule")),
            model_sha256=str(self._card.get("sha256", "")),
            training_data=", ".join(map(str, self._card.get("data", []))),
            balanced_accuracy=float(figures.get("balanced_accuracy", float("nan"))),
        )
        info.header.stamp = self.get_clock().now().to_msg()
        self._info.publish(info)

    def clock_jumped(self, delta_ns: int) -> None:  # noqa: ARG002
        """Histories before and after do not belong together."""
        self._judge_of.forget()

    def health(self) -> Iterable[Health]:
        """The model in use, frames judged, and refused by cause."""
        figures = {"judged": self._judged} | dict(self._refused)
        if self._problem:
            yield Health("model", Level.WARN, f"power rule: {self._problem}", figures)
        else:
            yield Health("model", Level.OK, str(self._card.get("version", "")), figures)

    def _load(self) -> Classifier | None:
        path = Path(self.parameters.model) if self.parameters.model else _shipped_model()
        try:
            classifier, self._card = load_classifier(path, self.parameters.device)
        except (ConfigurationError, ImportError, OSError) as error:
            self._problem = str(error)
            self.get_logger().warning(f"no model, the power rule serves: {error}")
            return None
        return classifier

    def _on_frame(self, frame: CirFrame) -> None:
        if len(self._waiting) == _MOST_WAITING:
            self._refused["overflow"] += 1
        self._waiting.append(frame)
        self._arrived.trigger()

    def _judge(self) -> None:
        waiting = list(self._waiting)
        self._waiting.clear()
        for _, group in groupby(waiting, tap_count):
            frames = list(group)
            links = [(frame.tag_id, frame.anchor_id) for frame in frames]
            stamps_ns = [to_stamp_ns(frame.header.stamp) for frame in frames]
            for frame, judged in zip(
                frames, self._judge_of.judge(to_cir_frames(frames), links, stamps_ns), strict=True
            ):
                self._judged += judged.refusal is Refusal.NOT
                if judged.refusal is not Refusal.NOT:
                    self._refused[judged.refusal.name.lower()] += 1
                self._states.publish(to_link_state(frame, judged))


def _shipped_model() -> Path:
    return Path(__file__).parents[1] / "models" / "los.safetensors"


def main() -> int:
    """Entry point."""
    return run(LosClassifier)


if __name__ == "__main__":
    sys.exit(main())
