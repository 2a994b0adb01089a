"""A bag through the nodes without middleware: which run, what they hear, the same each time."""

import hashlib
import shutil
from pathlib import Path

import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

from mine_loc_bringup.bag_messages import open_bag
from mine_loc_bringup.message_types import workspace_types
from mine_loc_bringup.offline_run import find_site, parse_changes, replay_offline
from mine_loc_bringup.topic_mapping import adapt
from mine_loc_core.errors import ConfigurationError

WALK = Path(__file__).parents[2] / "replay" / "walk" / "bag"
ROUND = "mine_loc_interfaces/msg/UwbRangeArray"


def digest(folder: Path) -> dict[str, str]:
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in folder.iterdir()}


def written(folder: Path, topic: str) -> list:
    types = workspace_types()
    with open_bag(folder) as bag:
        return [types.deserialize_cdr(each.data, each.type_name) for each in bag.read({topic})]


def bag_of(path: Path, topic: str, type_name: str, site: Path | None = None) -> Path:
    """A bag of one message."""
    types = workspace_types()
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(topic, type_name, typestore=types)
        writer.write(connection, 1, types.serialize_cdr(adapt(None, type_name, types, {}), type_name))
    if site:
        shutil.copytree(site, path / "site")
    return path


def test_two_replays_are_the_same_to_the_byte(tmp_path):
    for name in "ab":
        replay_offline(WALK, tmp_path / name / "out")
    assert digest(tmp_path / "a" / "out") == digest(tmp_path / "b" / "out")


def test_a_bag_runs_the_nodes_that_it_can_drive_and_no_driver(tmp_path):
    run = replay_offline(WALK, tmp_path / "out")
    assert run.nodes == ["uwb_solver", "pdr", "synchroniser", "fusion", "proximity"]
    assert not run.faults
    assert {"/fused/poses", "/pdr/steps", "/sync/epochs", "/diagnostics", "/truth/fitter/pose"} <= set(run.published)
    assert run.published["/fused/poses"] > 440  # ten a second, of 45 s


def test_what_a_node_that_runs_makes_is_not_fed_beside_it(tmp_path):
    """Positions and steps of an earlier replay drive the fusion alone; its own poses of then are not heard."""
    once = replay_offline(WALK, tmp_path / "once")
    shutil.copytree(WALK / "site", tmp_path / "once" / "site")
    twice = replay_offline(tmp_path / "once", tmp_path / "twice")
    assert twice.nodes == ["synchroniser", "fusion", "proximity"]
    assert 0 < twice.published["/fused/poses"] < 1.1 * once.published["/fused/poses"]


def test_a_parameter_is_set_for_one_replay(tmp_path):
    replay_offline(WALK, tmp_path / "ours")
    replay_offline(WALK, tmp_path / "ekf", changes=["fusion.method=ekf"])
    last = [written(tmp_path / name, "/fused/poses")[-1].people[0].pose.pose.position for name in ("ours", "ekf")]
    assert (last[0].x, last[0].y) != (last[1].x, last[1].y)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("fusion.method", "allowed: NODE.PARAMETER=VALUE"),
        ("fusoin.method=ekf", r"--set fusoin: not a node of this replay; allowed: uwb_solver"),
        ("fusion.method=best", "fusion: method: 'best' is not allowed; allowed: one of mine_loc"),
        ("fusion.methode=ekf", "fusion: methode: no such parameter"),
    ],
)
def test_a_bad_setting_is_refused_and_leaves_no_bag(change, says, tmp_path):
    with pytest.raises(ConfigurationError, match=says):
        replay_offline(WALK, tmp_path / "out", changes=[change])
    assert not (tmp_path / "out").exists()


def test_values_of_settings_are_yaml():
    assert parse_changes(["a.b=1.5", "a.c=text", "d.e=true"]) == {"a": {"b": 1.5, "c": "text"}, "d": {"e": True}}


def test_a_topic_of_another_type_is_refused_by_name(tmp_path):
    bag = bag_of(tmp_path / "bag", "/uwb/ranges", "sensor_msgs/msg/Imu", WALK / "site")
    with pytest.raises(ConfigurationError, match=f"/uwb/ranges: is a sensor_msgs/msg/Imu; allowed: {ROUND}"):
        replay_offline(bag, tmp_path / "out")


def test_a_bag_that_drives_nothing_is_refused_with_what_would(tmp_path):
    bag = bag_of(tmp_path / "bag", "/chatter", "std_msgs/msg/Header", WALK / "site")
    with pytest.raises(
        ConfigurationError, match=r"nothing to replay in topics /chatter; allowed: one of .*/uwb/ranges"
    ):
        replay_offline(bag, tmp_path / "out")


def test_a_bag_without_a_site_asks_for_one(tmp_path):
    bag = bag_of(tmp_path / "bag", "/uwb/ranges", ROUND)
    with pytest.raises(ConfigurationError, match="--site FOLDER"):
        find_site(bag)


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / "out").mkdir()
    with pytest.raises(ConfigurationError, match="is there already"):
        replay_offline(WALK, tmp_path / "out")


def test_the_refusal_of_a_node_is_told_in_its_words(tmp_path):
    with pytest.raises(ConfigurationError, match=r"uwb_solver: .*nowhere.yaml: cannot be read"):
        replay_offline(WALK, tmp_path / "out", changes=["uwb_solver.range_correction=nowhere.yaml"])
