"""A disk without a byte left under recorder and store: one line says so, and nothing is lost."""

import shutil
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import pytest
from graph.observer import Observer
from graph.processes import Running, node_command, running
from graph.recorder_kills import RECORDER
from graph.shuttle_site import write_shuttle_site
from graph.small_disk import SmallDisk, on_a_small_disk, why_not
from mine_loc_interfaces.msg import PersonPose, PersonPoseArray
from rosbags.highlevel import AnyReader
from std_msgs.msg import String

from mine_loc_bringup.bags.bag_folder import Storage
from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.qos import EVENTS

pytestmark = pytest.mark.graph

_RECORDER, _STORE = "recorder: recording", "store: database"
_SIZE_MB = 16


class Scene:
    """A node whose files are on a small disk."""

    def __init__(self, observer: Observer, run: Running, folder: Path) -> None:
        self.observer, self.run, self._folder = observer, run, folder

    def wait_for(self, happened: Callable[[], object], what: str) -> None:
        self.observer.wait_while_alive(self.run, happened, what)

    @contextmanager
    def disk(self) -> Iterator[SmallDisk]:
        disk = SmallDisk(self.run.process.pid, self._folder)
        try:
            yield disk
        finally:
            disk.close()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where the small disk goes."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if reason := why_not(folder):
        pytest.skip(f"no file system can be mounted: {reason}")
    return folder


@pytest.fixture
def scene_of(observer, domain, folder):
    @contextmanager
    def made(module: str, **parameters: object) -> Iterator[Scene]:
        words = on_a_small_disk(node_command(module, parameters), folder, _SIZE_MB)
        with running(words, domain, folder.parent / "log") as run:
            yield Scene(observer, run, folder)

    return made


@pytest.mark.parametrize("storage", list(Storage))
def test_a_recording_goes_on_when_there_is_room_and_misses_nothing(scene_of, folder, tmp_path, storage):
    with scene_of(RECORDER, bag=folder / "bag", topics="beat", storage=storage.value) as scene:
        observer = scene.observer
        beat = observer.node.create_publisher(String, "/beat", EVENTS)
        scene.wait_for(lambda: beat.get_subscription_count() > 0, "a recorder of beat")
        sent = 0

        def level() -> int | None:
            nonlocal sent
            beat.publish(String(data=f"{sent} {'x' * 5000}"))
            sent += 1
            return observer.level(_RECORDER)

        scene.wait_for(lambda: level() == 0 and observer.value(_RECORDER, "messages") > 20, "a good beginning")
        with scene.disk() as disk:
            disk.fill()
            scene.wait_for(lambda: level() == 2, "an error")
            disk.make_room()
            scene.wait_for(lambda: level() == 0, "room again")
            scene.wait_for(lambda: observer.value(_RECORDER, "messages") == sent, "all of it")
            scene.run.stop()
            shutil.copytree(disk.folder / "bag", tmp_path / "kept")
    assert scene.run.output.count("what was written is safe") == 1
    assert scene.run.output.count("recording goes on; 0 messages were dropped so far") == 1
    assert "Traceback" not in scene.run.output
    with AnyReader([tmp_path / "kept"]) as reader:
        numbers = [int(reader.deserialize(raw, each.msgtype).data.split()[0]) for each, _, raw in reader.messages()]
    assert numbers == list(range(sent))


def test_rows_wait_in_the_spool_and_come_into_the_database_when_there_is_room(scene_of, folder, tmp_path):
    site = write_shuttle_site(tmp_path / "site")
    database = f"sqlite:///{folder / 'store.db'}"
    with scene_of("mine_loc_bringup.nodes.store", site=site, database=database, spool_mb=4, flush_s=0.1) as scene:
        observer = scene.observer
        publisher = observer.node.create_publisher(PersonPoseArray, "fused/poses", EVENTS)
        scene.wait_for(lambda: _STORE in observer.status and publisher.get_subscription_count(), "the store")
        sent_ns: list[int] = []

        def level() -> int | None:
            sent_ns.append(time.time_ns())
            pose = PersonPose(person="fitter", mode=PersonPose.UWB_PDR, stamp=to_time(sent_ns[-1]))
            message = PersonPoseArray(people=[pose])
            message.header.frame_id = "map"
            publisher.publish(message)
            return observer.level(_STORE)

        def acknowledged() -> bool:
            return observer.value(_STORE, "acknowledged") == len(sent_ns)

        scene.wait_for(lambda: level() == 0 and observer.value(_STORE, "acknowledged") > 20, "a good beginning")
        with scene.disk() as disk:
            disk.fill()
            scene.wait_for(lambda: level() == 1 and observer.value(_STORE, "spooled_batches") > 3, "a warning")
            assert "full" in observer.status[_STORE].message or "disk I/O" in observer.status[_STORE].message
            scene.wait_for(acknowledged, "rows acknowledged on a full disk")
            disk.make_room()
            scene.wait_for(lambda: level() == 0 and not observer.value(_STORE, "spooled_batches"), "room again")
            scene.wait_for(acknowledged, "all rows")
            assert observer.value(_STORE, "lost") == 0
            scene.run.stop()
            shutil.copytree(disk.folder, tmp_path / "kept")
    assert "Traceback" not in scene.run.output
    with closing(sqlite3.connect(tmp_path / "kept" / "store.db")) as kept:
        assert [stamp for (stamp,) in kept.execute("SELECT stamp_ns FROM poses ORDER BY stamp_ns")] == sent_ns
        assert kept.execute("PRAGMA integrity_check").fetchone() == ("ok",)
