"""The nodes of a replay under /clock: jumps both ways, a clock that stands still, stamps from the future."""

import contextlib
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass

import pytest
from graph.domains import lent_domain
from graph.observer import Heard, Observer
from graph.processes import Running, node_command, running
from graph.walker import WALKER_TAG, person, position_m, ranging, write_site
from mine_loc_interfaces.msg import PersonPose, PersonPoseArray, UwbPose, UwbRange, UwbRangeArray
from rosgraph_msgs.msg import Clock

from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S, to_stamp_ns

pytestmark = pytest.mark.graph

MODULES = ("mine_loc_uwb.nodes.uwb_solver", "mine_loc_fusion.nodes.synchroniser", "mine_loc_fusion.nodes.fusion")
START_NS = 1_000 * NS_PER_S
STANDING_AT = position_m(0.0)


class Player:
    """Plays /clock every 10 ms and a round of a person who stands still every 100 ms, as long as somebody waits."""

    def __init__(self, observer: Observer) -> None:
        self._observer = observer
        self._clock = observer.node.create_publisher(Clock, "/clock", 10)
        self._ranges = observer.node.create_publisher(UwbRangeArray, "uwb/ranges", 10)
        self._rounds = 0
        self.jump_to(START_NS)

    def jump_to(self, stamp_ns: int) -> None:
        """Go on from here, as a bag that starts over."""
        self._origin_ns, self._origin_s = stamp_ns, time.monotonic()
        self._next_clock_ns = self._next_round_ns = stamp_ns

    @property
    def now_ns(self) -> int:
        return self._origin_ns + round((time.monotonic() - self._origin_s) * 1e9)

    def play(self) -> None:
        now_ns = self.now_ns
        if now_ns >= self._next_clock_ns:
            self._next_clock_ns = now_ns + 10 * NS_PER_MS
            self._clock.publish(Clock(clock=to_time(now_ns)))
        if now_ns >= self._next_round_ns:
            self._next_round_ns = now_ns + 100 * NS_PER_MS
            self.send_round(now_ns - 5 * NS_PER_MS)

    def send_round(self, stamp_ns: int) -> None:
        self._rounds += 1
        message = UwbRangeArray(tag_id=WALKER_TAG, reporter_id=1, seq=self._rounds)
        message.header.stamp = to_time(stamp_ns)
        jitter_m = 0.01 * math.sin(self._rounds)  # ranges that repeat to the millimetre would be called frozen
        message.ranges = [
            UwbRange(anchor_id=item.anchor_id, range=item.range_m + jitter_m, range_variance=0.01)
            for item in ranging(0.0, 0).ranges
        ]
        self._ranges.publish(message)


@dataclass(frozen=True)
class Replay:
    """The running nodes, their clock and their output."""

    runs: list[Running]
    observer: Observer
    player: Player
    poses: Heard

    def wait_for(self, happened: object, deadline_s: float = 20.0, what: str = "") -> float:
        def seen() -> object:
            self.player.play()
            return happened()

        return self.observer.wait_for(seen, deadline_s, what)

    def valid_since(self, instant_s: float) -> list[PersonPose]:
        """Outputs that came since then and belong to the present, by ranges."""
        return [
            item
            for array in self.poses.since(instant_s)
            for item in array.people
            if abs(to_stamp_ns(item.stamp) - self.player.now_ns) < NS_PER_S and item.mode == PersonPose.UWB_ONLY
        ]

    def wait_until_valid(self, deadline_s: float) -> float:
        since_s = time.monotonic()
        return self.wait_for(lambda: len(self.valid_since(since_s)) > 2, deadline_s, "valid output")


@pytest.fixture(scope="module")
def replay(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Replay]:
    folder = tmp_path_factory.mktemp("replay")
    parameters = {"site": write_site(folder / "site", [], [person("walker", WALKER_TAG)]), "use_sim_time": True}
    with contextlib.ExitStack() as stack:
        domain = stack.enter_context(lent_domain())
        observer = Observer(domain)
        stack.callback(observer.close)
        poses = observer.listen(PersonPoseArray, "fused/poses")
        solved = observer.listen(UwbPose, "uwb/pose")
        runs = [
            stack.enter_context(running(node_command(module, parameters), domain, folder / module))
            for module in MODULES
        ]
        replay = Replay(runs, observer, Player(observer), poses)
        replay.wait_until_valid(20.0)
        replay.wait_for(lambda: len(solved), what="the solver, which the fusion does not wait for")
        yield replay


@pytest.mark.parametrize("jump_s", [-300.0, 300.0, -2.0, 2.0], ids=lambda s: f"{s:+g} s")
def test_output_is_valid_again_within_a_second_of_a_jump(replay, jump_s):
    replay.wait_until_valid(20.0)
    told = [run.output.count("time jumped by") for run in replay.runs]
    replay.player.jump_to(replay.player.now_ns + round(jump_s * NS_PER_S))
    jumped_s = time.monotonic()
    replay.wait_until_valid(1.0)
    for item in replay.valid_since(jumped_s):
        position = item.pose.pose.position
        assert math.dist((position.x, position.y), STANDING_AT) < 0.3
        assert math.isfinite(item.horizontal_ce95)

    def telling() -> list[int]:
        return [run.output.count("time jumped by") for run in replay.runs]

    replay.wait_for(lambda: all(now > before for now, before in zip(telling(), told, strict=True)), 1.0, "every node")
    assert telling() == [count + 1 for count in told]
    assert all(run.alive for run in replay.runs)


def test_after_a_jump_output_stamps_rise_again_from_the_new_time(replay):
    replay.wait_until_valid(20.0)
    replay.player.jump_to(START_NS)
    jumped_s = time.monotonic()
    replay.wait_for(lambda: len(replay.valid_since(jumped_s)) > 6)
    stamps = [to_stamp_ns(item.stamp) for item in replay.valid_since(jumped_s)]
    assert stamps == sorted(stamps)


def test_a_stamp_from_the_future_is_refused_and_counted(replay):
    observer = replay.observer
    inputs = "synchroniser: inputs"
    replay.wait_for(lambda: inputs in observer.status)
    before = observer.value(inputs, "future")
    sent_s = time.monotonic()
    future_ns = replay.player.now_ns + 10 * NS_PER_S
    replay.player.send_round(future_ns)
    replay.wait_for(lambda: observer.value(inputs, "future") > before, what="the count of future stamps")
    replay.wait_for(lambda: len(replay.valid_since(sent_s)) > 5)
    outputs = [item for array in replay.poses.since(sent_s) for item in array.people]
    assert max(to_stamp_ns(item.stamp) for item in outputs) < future_ns
    assert observer.level(inputs) == 1


def test_diagnostics_go_on_while_the_clock_stands_still_and_no_node_burns_a_core(replay):
    heard = replay.observer.status
    replay.wait_until_valid(20.0)
    before_s = [run.cpu_s for run in replay.runs]
    for _ in range(3):
        heard.clear()
        replay.observer.wait_for(
            lambda: {name.split(":")[0] for name in heard} >= {"uwb_solver", "synchroniser", "fusion"}, 5.0
        )
    for run, cpu_s in zip(replay.runs, before_s, strict=True):
        assert run.cpu_s - cpu_s < 1.0
    replay.wait_until_valid(5.0)
