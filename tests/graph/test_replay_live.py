"""A bag played into the graph: loops, pauses, jumps forward, and what is played of it."""

import contextlib
import itertools
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from graph.domains import lent_domain
from graph.observer import Heard, Observer
from graph.processes import Running, running, up_command
from mine_loc_interfaces.msg import PersonPose, PersonPoseArray
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool

from mine_loc_bringup.main import main
from mine_loc_core.stamps import NS_PER_S, to_stamp_ns

pytestmark = pytest.mark.graph

SITE = Path(__file__).parents[2] / "config" / "example_mine"
NODES = ("uwb_solver", "pdr", "synchroniser", "fusion")
BAG_S = 5
QUIET_S = 0.3
VALID = {PersonPose.UWB_PDR, PersonPose.UWB_ONLY}


@dataclass(frozen=True)
class Graph:
    """The nodes under /clock, and what is heard of them."""

    folder: Path
    domain: int
    up: Running
    observer: Observer
    clock: Heard
    poses: Heard

    @contextlib.contextmanager
    def replay(self, *more: str) -> Iterator[Running]:
        """A replay, and afterwards silence on /clock."""
        words = [sys.executable, "-m", "mine_loc_bringup.main", "replay", str(self.folder / "bag"), "--live", *more]
        with running(words, self.domain, self.folder / "replay.log") as run:
            yield run
        ended_s = time.monotonic()  # what was said before is heard only from now on
        self.observer.wait_for(
            lambda: time.monotonic() - max(self.clock.at_s[-1], ended_s) > QUIET_S, what="silence on /clock"
        )

    def valid_since(self, instant_s: float, later_than_ns: int = 0) -> list[float]:
        """When poses came since then that belong to the present of the clock and rest on ranges."""
        return [
            at_s
            for array, at_s in zip(self.poses.messages, self.poses.at_s, strict=True)
            if at_s > instant_s
            for item in array.people
            if item.mode in VALID
            and later_than_ns < to_stamp_ns(item.stamp)
            and abs(to_stamp_ns(item.stamp) - self.clock_ns(at_s)) < NS_PER_S
        ]

    def clock_ns(self, at_s: float) -> int:
        """The clock that was last heard at an instant."""
        return next(
            to_stamp_ns(message.clock)
            for message, heard_s in zip(reversed(self.clock.messages), reversed(self.clock.at_s), strict=True)
            if heard_s <= at_s
        )

    def jumps(self, since_s: float) -> list[float]:
        """When the clock was set back."""
        heard = zip(self.clock.messages, self.clock.at_s, strict=True)
        return [
            at_s
            for (before, _), (message, at_s) in itertools.pairwise(heard)
            if at_s > since_s and to_stamp_ns(message.clock) < to_stamp_ns(before.clock)
        ]

    def wait_valid(self, since_s: float, deadline_s: float, later_than_ns: int = 0) -> float:
        """When the first valid pose came."""
        self.observer.wait_for(lambda: self.valid_since(since_s, later_than_ns), deadline_s, "valid poses")
        return self.valid_since(since_s, later_than_ns)[0]

    def wait_moving(self, since_s: float) -> tuple[float, int]:
        """When the clock of a replay moved first, and its time [ns]."""
        heard = self.clock.since

        def moving() -> list[int]:
            stamps = [to_stamp_ns(message.clock) for message in heard(since_s)]
            return [index for index, stamp_ns in enumerate(stamps) if stamp_ns > stamps[0]]

        self.observer.wait_for(moving, 20.0, "a clock that moves")
        at_s = [each for each in self.clock.at_s if each > since_s]
        return at_s[moving()[0]], to_stamp_ns(heard(since_s)[0].clock)


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Graph]:
    folder = tmp_path_factory.mktemp("replay")
    words = ["simulate", "--site", str(SITE), "--people", "2", "--seconds", str(BAG_S), "--bag", str(folder / "bag")]
    assert main(words) == 0
    with contextlib.ExitStack() as stack:
        domain = stack.enter_context(lent_domain())
        observer = Observer(domain)
        stack.callback(observer.close)
        clock = observer.listen(Clock, "/clock")
        poses = observer.listen(PersonPoseArray, "fused/poses")
        up = stack.enter_context(running(up_command(SITE, "--sim-time", "--only", *NODES), domain, folder / "up.log"))
        observer.wait_for(lambda: {name.split(":")[0] for name in observer.status} >= set(NODES), what="every node")
        yield Graph(folder, domain, up, observer, clock, poses)


def test_a_looped_bag_gives_valid_output_within_a_second_of_each_loop(graph, record_property):
    began_s = time.monotonic()
    with graph.replay("--loop") as replay:
        graph.observer.wait_for(lambda: len(graph.jumps(began_s)) >= 2, 60.0, "two loops")
        last_s = graph.jumps(began_s)[-1]
        graph.wait_valid(last_s, 5.0)
        assert replay.alive
    waits_s = [graph.valid_since(jump_s)[0] - jump_s for jump_s in graph.jumps(began_s)]
    record_property("waits_s", waits_s)
    assert len(waits_s) >= 2
    assert max(waits_s) < 1.0
    assert "time jumped by" in graph.up.output
    assert "died" not in graph.up.output


def test_a_pause_stops_the_clock_and_going_on_gives_valid_output(graph):
    with graph.replay():
        moving_s, start_ns = graph.wait_moving(time.monotonic())
        graph.wait_valid(moving_s, 2.0, start_ns)
        answer = graph.observer.call(SetBool, "/player/pause", SetBool.Request(data=True))
        assert (answer.success, answer.message) == (True, "paused")
        since_s = time.monotonic() + 0.1
        graph.observer.wait_for(lambda: len(graph.clock.since(since_s)) > 30, what="the clock goes on being told")
        (paused_ns,) = {to_stamp_ns(message.clock) for message in graph.clock.since(since_s)}
        resumed_s = time.monotonic()
        assert graph.observer.call(SetBool, "/player/pause", SetBool.Request(data=False)).message == "playing"
        graph.wait_valid(resumed_s, 1.0, paused_ns)


def test_a_replay_that_begins_later_sets_the_clock_forward(graph):
    with graph.replay():
        moving_s, start_ns = graph.wait_moving(time.monotonic())
        graph.wait_valid(moving_s, 2.0, start_ns)
    before_ns = to_stamp_ns(graph.clock.messages[-1].clock)
    told = graph.up.output.count("time jumped by +")
    with graph.replay("--start", "3"):
        moving_s, start_ns = graph.wait_moving(time.monotonic())
        assert start_ns > before_ns + NS_PER_S
        assert graph.wait_valid(moving_s, 2.0, start_ns) - moving_s < 1.0
        graph.observer.wait_for(
            lambda: graph.up.output.count("time jumped by +") >= told + len(NODES), what="every node hears of the jump"
        )
