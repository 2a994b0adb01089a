"""The recorder beside nodes of other namespaces: what it finds, what it keeps of it, and what it says."""

import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from graph.observer import Observer
from graph.processes import Running
from graph.recorder_kills import recorder
from mine_loc_interfaces.msg import PersonPose, PersonPoseArray
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from std_msgs.msg import Int32, String

from mine_loc_bringup.bags.bag_folder import Storage
from mine_loc_core.nodes.qos import EVENTS, LATCHED

pytestmark = pytest.mark.graph

BEST_EFFORT = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
STATUS = "recorder: recording"


class Scene:
    """A recorder, and the publishers of a test."""

    def __init__(self, observer: Observer, run: Running) -> None:
        self.observer, self.run = observer, run

    def publisher(self, kind: type, topic: str, qos: Any) -> Any:
        """One that the recorder hears."""
        publisher = self.observer.node.create_publisher(kind, topic, qos)
        self.wait_for(lambda: publisher.get_subscription_count() > 0, f"a recorder of {topic}")
        return publisher

    def wait_for(self, happened: Callable[[], Any], what: str) -> None:
        self.observer.wait_while_alive(self.run, happened, what)

    def end(self) -> None:
        self.run.stop()


def messages(bag: Path) -> dict[str, list[Any]]:
    found: dict[str, list[Any]] = {}
    with AnyReader([bag]) as reader:
        for connection, _, raw in reader.messages():
            found.setdefault(connection.topic, []).append(reader.deserialize(raw, connection.msgtype))
    return found


@pytest.mark.parametrize("storage", list(Storage))
def test_topics_are_recorded_as_they_appear_with_types_and_quality_of_service(observer, domain, tmp_path, storage):
    parameters = {"storage": storage.value, "topics": "fused/*,map,fast,later", "exclude": "/b/**"}
    with recorder(tmp_path, domain, **parameters) as run:
        scene = Scene(observer, run)
        observer.node.create_publisher(String, "/b/map", LATCHED)
        latched = observer.node.create_publisher(String, "/a/map", LATCHED)
        latched.publish(String(data="before anybody listened"))
        poses = scene.publisher(PersonPoseArray, "/a/fused/poses", EVENTS)
        fast = scene.publisher(Int32, "/fast", BEST_EFFORT)
        poses.publish(PersonPoseArray(instance="one", people=[PersonPose(person="ann", horizontal_ce95=0.5)]))
        fast.publish(Int32(data=7))
        scene.publisher(String, "/a/later", EVENTS).publish(String(data="later"))
        scene.wait_for(lambda: observer.value(STATUS, "messages") == 4, "four messages")
        scene.end()
    found = messages(tmp_path / "bag")
    assert set(found) == {"/a/map", "/a/fused/poses", "/fast", "/a/later"}
    assert found["/a/map"][0].data == "before anybody listened"
    assert found["/a/fused/poses"][0].people[0].horizontal_ce95 == 0.5
    with AnyReader([tmp_path / "bag"]) as reader:
        offered = {each.topic: each.ext.offered_qos_profiles[0] for each in reader.connections}
        definition = next(each.msgdef.data for each in reader.connections if each.topic == "/a/fused/poses")
    assert offered["/fast"].reliability is QosReliability.BEST_EFFORT
    assert offered["/a/map"].durability is QosDurability.TRANSIENT_LOCAL
    assert offered["/a/fused/poses"].durability is QosDurability.VOLATILE
    assert "MSG: mine_loc_interfaces/PersonPose" in definition


def test_a_publisher_that_offers_less_is_heard_too_from_when_it_appears(observer, domain, tmp_path):
    with recorder(tmp_path, domain, topics="mixed") as run:
        scene = Scene(observer, run)
        first = scene.publisher(Int32, "/mixed", LATCHED)
        first.publish(Int32(data=1))
        scene.wait_for(lambda: observer.value(STATUS, "messages") == 1, "the latched one")
        second = scene.publisher(Int32, "/mixed", BEST_EFFORT)
        scene.wait_for(lambda: first.get_subscription_count() > 0, "both heard")
        second.publish(Int32(data=2))
        first.publish(Int32(data=3))
        scene.wait_for(lambda: observer.value(STATUS, "messages") == 3, "messages of both")
        scene.end()
    assert sorted(item.data for item in messages(tmp_path / "bag")["/mixed"]) == [1, 2, 3]


def test_each_part_begins_with_what_is_latched_and_static(observer, domain, tmp_path):
    with recorder(tmp_path, domain, topics="map,beat", split_duration_s=0.5) as run:
        scene = Scene(observer, run)
        scene.publisher(String, "/map", LATCHED).publish(String(data="north"))
        beat = scene.publisher(Int32, "/beat", EVENTS)

        def parts() -> int:
            beat.publish(Int32(data=0))
            return observer.value(STATUS, "parts")

        scene.wait_for(lambda: parts() >= 3, "three parts")
        scene.end()
    files = sorted((tmp_path / "bag").glob("*.mcap"))
    assert len(files) >= 3
    for file in files[1:-1]:
        with AnyReader([file]) as reader:
            first = next(iter(reader.messages()))
            assert first[0].topic == "/map"
            assert reader.deserialize(first[2], first[0].msgtype).data == "north"


def test_unknown_topics_and_types_are_named_once_each(observer, domain, tmp_path):
    with recorder(tmp_path, domain, topics="nowhere,both,known") as run:
        scene = Scene(observer, run)
        known = scene.publisher(Int32, "/known", EVENTS)
        both = scene.publisher(Int32, "/both", EVENTS)
        elsewhere = Observer(domain)  # a process has one type a topic
        other = elsewhere.node.create_publisher(String, "/both", EVENTS)
        scene.wait_for(lambda: "recorder: topics" in observer.status, "the refusal")
        known.publish(Int32(data=1))
        both.publish(Int32(data=2))
        other.publish(String(data="not heard"))
        scene.wait_for(lambda: observer.value(STATUS, "messages") == 2, "messages")
        scene.end()
        elsewhere.close()
        said = run.output
    assert said.count("nowhere: nobody publishes a topic of this name") >= 1
    assert said.count("/both: recorded as std_msgs/msg/Int32 alone, and std_msgs/msg/String is published too") == 1
    assert set(messages(tmp_path / "bag")) == {"/known", "/both"}


def test_a_bag_that_is_there_already_is_refused_in_one_line(domain, tmp_path):
    (tmp_path / "bag").mkdir()
    with recorder(tmp_path, domain) as run:
        assert run.ends() == 2
    assert "is there already; allowed: a new name" in run.output
    assert "Traceback" not in run.output


def test_it_stops_within_a_second(observer, domain, tmp_path):
    with recorder(tmp_path, domain) as run:
        Scene(observer, run).wait_for(lambda: STATUS in observer.status, "the recorder")
        assert run.stop(signal.SIGINT) < 2.0
        assert run.ends() == 0
    assert (tmp_path / "bag" / "metadata.yaml").exists()
