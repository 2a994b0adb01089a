"""people.yaml edited under `mine-loc up`: whoever is new is served at once, and nobody else notices."""

import itertools
import time
from collections.abc import Iterator

import pytest
from geometry_msgs.msg import PoseWithCovarianceStamped
from graph.live_graph import NODES, LiveGraph, live_graph
from graph.walker import VISITOR_TAG, WALKER_TAG, frame, imu_bytes, person, ranging, write_people
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu

from mine_loc_core.nodes.qos import STREAM
from mine_loc_sim.serial_lines import PseudoSerial

pytestmark = pytest.mark.graph

NEWCOMER_TAG = 19


@pytest.fixture
def graph(tmp_path) -> Iterator[LiveGraph]:
    with live_graph(tmp_path) as running_graph:
        yield running_graph


class Newcomer:
    """Sends a sample every 10 ms and a round every 100 ms, as long as somebody waits."""

    def __init__(self, graph: LiveGraph) -> None:
        self.line = PseudoSerial(graph.folder / "n100_newcomer")
        self._graph = graph
        self._start_s = time.monotonic()
        self._samples = 0

    def send(self) -> None:
        while self._samples * 0.01 < time.monotonic() - self._start_s:
            self._samples += 1
            self.line.write(imu_bytes(self._samples * 0.01, self._samples))
            if self._samples % 10 == 0:
                number = self._samples // 10
                self._graph.walker.uwb.write(frame(ranging(self._samples * 0.01, number, NEWCOMER_TAG), number))


def test_a_new_person_is_positioned_and_the_others_go_on_undisturbed(graph):
    observer, site = graph.observer, graph.folder / "site"
    newcomer = Newcomer(graph)
    topics = [
        observer.listen(Imu, "newcomer/imu/data", STREAM),
        observer.listen(Odometry, "newcomer/odometry"),
        observer.listen(PoseWithCovarianceStamped, "people/newcomer/pose"),
    ]
    walkers = observer.listen(PoseWithCovarianceStamped, "people/walker/pose")
    observer.wait_for(lambda: len(walkers) > 3)
    before = {name: graph.up.node_process(name).pid for name in NODES}
    people = [person("walker", WALKER_TAG, graph.folder / "n100"), person("visitor", VISITOR_TAG)]

    write_people(site, [*people, person("newcomer", NEWCOMER_TAG, newcomer.line.port)])
    edited_s = time.monotonic()

    def served() -> bool:
        newcomer.send()
        return all(topics)

    observer.wait_for(served, what="samples, odometry and poses of the newcomer")
    assert {name: graph.up.node_process(name).pid for name in before} == before
    arrivals = [at_s for at_s in walkers.at_s if at_s > edited_s]
    assert max(later - earlier for earlier, later in itertools.pairwise(arrivals)) < 1.0

    write_people(site, people)
    observer.wait_for(lambda: "[n100_driver] newcomer/n100_driver stopped" in graph.up.output)
    assert "walker/n100_driver stopped" not in graph.up.output


def test_a_bad_edit_is_reported_and_changes_nothing(graph):
    (graph.folder / "site" / "people.yaml").write_text(
        "schema: 1\npeople:\n  - {name: walker, tag_id: -4, height_m: 1.7}\n"
    )
    graph.observer.wait_for(lambda: "The people stay as they were." in graph.up.output)
    line = next(line for line in graph.up.output.splitlines() if "people.yaml:3" in line)
    assert "tag_id" in line
    assert "allowed" in line
    graph.observer.wait_for(lambda: graph.observer.level("fusion: people.yaml") == 1)
    assert all(graph.up.node_process(name) for name in NODES)
