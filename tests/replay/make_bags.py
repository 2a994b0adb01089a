"""Makes the bags of the replay tests anew: simulated scenes, thinned and compressed.

    python tests/replay/make_bags.py        writes tests/replay/<scene>/bag, each with its site

The same program writes the same messages; a changed simulator may write others, and then expectations are to be looked
at again.
"""

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path

from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer

from mine_loc_bringup.bag_messages import open_bag
from mine_loc_bringup.main import main as mine_loc
from mine_loc_bringup.message_types import workspace_types

FOLDER = Path(__file__).parent
SITES = FOLDER.parents[1] / "config"


@dataclass(frozen=True)
class Scene:
    """One bag: what is simulated, and what of it is kept (topic → every so many messages)."""

    site: str
    arguments: tuple[str, ...]
    keep: dict[str, int]


SCENES = {
    "walk": Scene(
        "example_mine",
        ("--people", "1", "--seconds", "45", "--seed", "11"),
        {"/uwb/ranges": 1, "/fitter/imu/data": 1, "/truth/fitter/pose": 5, "/truth/steps": 1},
    ),
    "judged_links": Scene(
        "example_mine",
        ("--people", "1", "--seconds", "8", "--seed", "12", "--cir"),
        {
            "/uwb/ranges": 1,
            "/uwb/cir": 1,
            "/fitter/imu/data": 1,
            "/truth/fitter/pose": 5,
        },
    ),
    "damaged_lines": Scene(
        "example_mine",
        (
            *("--people", "1", "--seconds", "30", "--seed", "14"),
            *("--fault", "noise@4+3", "--fault", "truncation@9+3", "--fault", "stall@14+1.5"),
            *("--fault", "unplug@18+3", "--fault", "clock_step@24+1"),
        ),
        {"/uwb/ranges": 1, "/fitter/imu/data": 1, "/truth/fitter/pose": 5},
    ),
    "bearings": Scene(
        "field_15km",
        ("--people", "2", "--seconds", "60", "--seed", "13"),
        {"/coarse/bearings": 1, "/truth/scout/pose": 25, "/truth/medic/pose": 25},
    ),
}


def make(name: str, scene: Scene) -> None:
    """Simulate a scene and keep what its tests need."""
    target = FOLDER / name / "bag"
    shutil.rmtree(target, ignore_errors=True)
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "bag"
        mine_loc(["simulate", "--site", str(SITES / scene.site), *scene.arguments, "--bag", str(source)])
        writer = Writer(target, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with open_bag(source) as bag, writer:
            topics = {
                topic: writer.add_connection(topic, bag.topics[topic], typestore=workspace_types())
                for topic in scene.keep
            }
            seen = dict.fromkeys(scene.keep, 0)
            for message in bag.read(set(scene.keep)):
                if seen[message.topic] % scene.keep[message.topic] == 0:
                    writer.write(topics[message.topic], message.log_ns, message.data)
                seen[message.topic] += 1
        shutil.copytree(source / "site", target / "site")


if __name__ == "__main__":
    for each in SCENES.items():
        make(*each)
