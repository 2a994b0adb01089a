"""Accumulators on a serial line become link states, which join the epoch of their round."""

import math
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from graph.live_graph import LiveGraph, live_graph
from graph.observer import Observer
from graph.processes import Running
from graph.walker import VISITOR_TAG, frame, ranging
from mine_loc_interfaces.msg import CirFrame, CirFrameArray, Epoch, LinkState, LinkStateArray, LosModelInfo

from mine_loc_core.nodes.qos import EVENTS, LATCHED
from mine_loc_core.stamps import to_stamp_ns
from mine_loc_uwb.ranging import CirWindow
from mine_loc_uwb.wire.mine_loc_frame import encode_frame
from mine_loc_uwb.wire.mine_loc_payload import FrameType, encode_cir

pytestmark = pytest.mark.graph
NODE = ["python3", "-m", "mine_loc_uwb.nodes.los_classifier", "--ros-args", "-r", "__node:=los_classifier"]


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveGraph]:
    with live_graph(tmp_path_factory.mktemp("los")) as running_graph:
        yield running_graph


def samples(*, silent: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Window of 128 taps from 730 on with a lone path at 746."""
    counts = 40.0 * np.random.default_rng(1).standard_normal((2, 128)) * (not silent)
    counts[0, 16] += 0.0 if silent else 12_000.0
    in_phase, quadrature = np.rint(counts).astype(np.int16)
    return in_phase, quadrature


def window(anchor: int, number: int, at_s: float) -> bytes:
    in_phase, quadrature = samples()
    ticks = round((at_s + 100.0) * 1e6) + 1000 * anchor
    received = CirWindow(
        VISITOR_TAG, anchor, number, ticks, 8.0, 746.0, 730, 400, 40.0, (9000, 9000, 3000), 8000, 5, 64,
        in_phase, quadrature,
    )  # fmt: skip
    return encode_frame(FrameType.CIR, number, encode_cir(received))


class Visitor:
    """Ranges five times a second, with an accumulator of every exchange, as long as somebody asks."""

    def __init__(self, graph: LiveGraph) -> None:
        self._graph, self._began_s, self.rounds = graph, time.monotonic(), 0

    def send(self) -> None:
        at_s = time.monotonic() - self._began_s
        while self.rounds * 0.2 < at_s:
            self.rounds += 1
            round_s = self.rounds * 0.2
            made = ranging(round_s, self.rounds, VISITOR_TAG)
            told = frame(made, self.rounds) + b"".join(
                window(each.anchor_id, self.rounds, round_s) for each in made.ranges
            )
            self._graph.walker.uwb.write(told)


def test_link_states_join_the_epoch_of_their_round(graph):
    """Of one instant and number; at the start they may come after the epoch, until the synchroniser waits for them."""
    observer, visitor = graph.observer, Visitor(graph)
    judged, epochs = observer.listen(LinkStateArray, "uwb/link_state"), observer.listen(Epoch, "sync/epochs")
    accumulators = observer.listen(CirFrameArray, "uwb/cir")

    def joined() -> list[Any]:
        visitor.send()
        return [each for each in epochs.messages if each.ranges and len(each.link_states) == 5]

    observer.wait_for(lambda: len(joined()) > 3, 30.0, "epochs with all link states of their round")
    for epoch in joined():
        assert {state.range_seq for state in epoch.link_states} == {epoch.ranges[0].seq}
        assert {state.anchor_id for state in epoch.link_states} == {1, 2, 3, 4, 5}
    for state in (state for array in judged.messages for state in array.states):
        assert (state.method, state.refusal) == (LinkState.METHOD_NETWORK, LinkState.REFUSED_NOT)
        assert sum(state.class_probability) == pytest.approx(1.0, abs=1e-4)
        assert state.los_probability == pytest.approx(sum(state.class_probability[2:]), abs=1e-4)
    together = {to_stamp_ns(each.header.stamp): [f.anchor_id for f in each.frames] for each in accumulators.messages}
    assert list(together.values()) == [[1, 2, 3, 4, 5]] * len(together)
    for array in judged.messages:
        assert [state.anchor_id for state in array.states] == together[to_stamp_ns(array.header.stamp)]


def test_the_model_in_use_is_told_to_whoever_comes_late(graph):
    heard = graph.observer.listen(LosModelInfo, "los_classifier/model_info", LATCHED)
    graph.observer.wait_for(lambda: len(heard))
    info = heard.messages[0]
    assert info.training_data == "uwb_cirs_2018"
    assert len(info.model_sha256) == 64
    assert 0.9 < info.balanced_accuracy < 1.0


def message(*, taps: int = 128, silent: bool = False, **fields: Any) -> CirFrame:
    in_phase, quadrature = samples(silent=silent)
    frame_ = CirFrame(tag_id=1, anchor_id=2, first_path_index=746.0, start_index=730, preamble_count=400, **fields)
    frame_.range = 4.0
    frame_.receive_power, frame_.first_path_power = -80.0, -88.0
    frame_.in_phase.frombytes(in_phase[:taps].tobytes())
    frame_.quadrature.frombytes(quadrature[:taps].tobytes())
    return frame_


def judge(observer: Observer, sent: list[CirFrame]) -> list[LinkState]:
    """What the node says of the frames of a round."""
    heard = observer.listen(LinkStateArray, "uwb/link_state")
    publisher = observer.node.create_publisher(CirFrameArray, "uwb/cir", EVENTS)
    observer.wait_for(lambda: publisher.get_subscription_count() and "los_classifier: model" in observer.status)
    publisher.publish(CirFrameArray(frames=sent))
    observer.wait_for(lambda: len(heard))
    return heard.messages[0].states


def test_frames_that_cannot_be_read_are_refused_by_name_and_counted(domain, observer, tmp_path):
    node = Running(NODE, domain, tmp_path / "log")
    sent = [message(), message(taps=60), message(silent=True), message(taps=0), message()]
    sent[4].first_path_index = math.nan
    try:
        found = judge(observer, sent)
        refusals = [state.refusal for state in found]
        assert refusals == [
            LinkState.REFUSED_NOT, LinkState.REFUSED_TRUNCATED, LinkState.REFUSED_EMPTY, LinkState.REFUSED_EMPTY,
            LinkState.REFUSED_NO_FIRST_PATH,
        ]  # fmt: skip
        assert [math.isnan(state.los_probability) for state in found] == [False, True, True, True, True]
        model = "los_classifier: model"
        observer.wait_for(lambda: observer.value(model, "judged") == 1 and observer.value(model, "empty") == 2)
        assert observer.value(model, "truncated") == observer.value(model, "no_first_path") == 1
    finally:
        node.stop()


def test_without_a_model_the_power_rule_judges_and_says_so(domain, observer, tmp_path):
    node = Running([*NODE, "-p", "model:=/nowhere.safetensors"], domain, tmp_path / "log")
    try:
        (state,) = judge(observer, [message()])
        assert state.method == LinkState.METHOD_POWER_RULE
        assert state.los_probability == pytest.approx(0.5)
        assert state.most_likely_class == LinkState.CLASS_UNKNOWN
        observer.wait_for(lambda: observer.level("los_classifier: model") == 1)
        assert "no such file" in observer.status["los_classifier: model"].message
    finally:
        node.stop()
