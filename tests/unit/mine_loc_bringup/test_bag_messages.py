"""Reading bags: of every writer of rosbags, of ROS 1, with other definitions; and what is none."""

import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from mine_loc_bringup.bag_messages import open_bag
from mine_loc_bringup.message_types import workspace_types
from mine_loc_bringup.topic_mapping import TopicMapping, adapt
from mine_loc_core.errors import ConfigurationError

ROUND = "mine_loc_interfaces/msg/UwbRangeArray"
OLDER = "std_msgs/Header header\nuint64 tag_id\nuint64 gone\n"


def a_round(tag_id: int) -> bytes:
    types = workspace_types()
    message = adapt(None, ROUND, types, {})
    message.tag_id = tag_id
    return bytes(types.serialize_cdr(message, ROUND))


def write(path, plugin, compression=CompressionMode.NONE):
    writer = Writer2(path, version=9, storage_plugin=plugin)
    writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        topic = writer.add_connection("/uwb/ranges", ROUND, typestore=workspace_types())
        for number in range(3):
            writer.write(topic, 10 + number, a_round(number))
    return path


def read(path, mapping=None):
    with open_bag(path, mapping) as bag:
        return bag.topics, list(bag.read(set(bag.topics)))


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
@pytest.mark.parametrize("compression", [CompressionMode.NONE, CompressionMode.FILE, CompressionMode.MESSAGE])
def test_bags_of_rosbags_writers_are_read_as_they_are(plugin, compression, tmp_path):
    topics, messages = read(write(tmp_path / "bag", plugin, compression))
    assert topics == {"/uwb/ranges": ROUND}
    assert [(each.log_ns, each.topic, each.data) for each in messages] == [
        (10 + number, "/uwb/ranges", a_round(number)) for number in range(3)
    ]


def test_only_wanted_topics_are_read(tmp_path):
    with open_bag(write(tmp_path / "bag", StoragePlugin.MCAP)) as bag:
        assert list(bag.read({"/fused/poses"})) == []
        assert len(list(bag.read({"/uwb/ranges"}))) == 3


def test_an_older_definition_is_read_by_field_name(tmp_path):
    types = get_typestore(Stores.ROS2_JAZZY)
    types.register(get_types_from_msg(OLDER, ROUND))
    header = adapt(None, "std_msgs/msg/Header", types, {})
    with Writer2(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/uwb/ranges", ROUND, typestore=types)
        writer.write(topic, 5, types.serialize_cdr(types.types[ROUND](header=header, tag_id=7, gone=1), ROUND))
    _, [message] = read(tmp_path / "bag")
    array = workspace_types().deserialize_cdr(message.data, ROUND)
    assert (array.tag_id, array.ranges) == (7, [])


def test_a_bag_of_ros_1_is_read_in_our_definitions(tmp_path):
    types = get_typestore(Stores.ROS1_NOETIC)
    header = types.types["std_msgs/msg/Header"](3, types.types["builtin_interfaces/msg/Time"](1, 2), "imu")
    vector = types.types["geometry_msgs/msg/Vector3"](1.0, 2.0, 3.0)
    stamped = types.types["geometry_msgs/msg/Vector3Stamped"](header, vector)
    with Writer1(tmp_path / "one.bag") as writer:
        topic = writer.add_connection("/force", stamped.__msgtype__, typestore=types)
        writer.write(topic, 5, types.serialize_ros1(stamped, stamped.__msgtype__))
    _, [message] = read(tmp_path / "one.bag", TopicMapping({"/force": {"topic": "f"}}))
    assert message.topic == "/f"
    read_back = workspace_types().deserialize_cdr(message.data, message.type_name)
    assert (read_back.header.frame_id, read_back.header.stamp.nanosec, read_back.vector.z) == ("imu", 2, 3.0)


def test_what_is_no_bag_is_refused_with_its_name_and_what_is_allowed(tmp_path):
    (tmp_path / "file.bag").write_bytes(b"no bag at all")
    (tmp_path / "folder").mkdir()
    for path in (tmp_path / "file.bag", tmp_path / "folder", tmp_path / "nothing"):
        with pytest.raises(ConfigurationError, match=rf"{path.name}.*allowed: a folder of rosbag2 or a .bag file"):
            read(path)


def test_a_bag_that_breaks_off_is_refused_in_one_line(tmp_path):
    path = write(tmp_path / "bag", StoragePlugin.MCAP)
    file = path / "bag.mcap"
    file.write_bytes(file.read_bytes()[:-200])
    with pytest.raises(ConfigurationError, match=r"bag.*allowed: .*bag") as refused:
        read(path)
    assert "\n" not in str(refused.value)


def test_a_message_that_is_not_what_its_definition_says_is_refused(tmp_path):
    types = get_typestore(Stores.ROS2_JAZZY)
    types.register(get_types_from_msg(OLDER, ROUND))
    with Writer2(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/uwb/ranges", ROUND, typestore=types)
        writer.write(topic, 5, b"\x00\x01\x00\x00rubbish")
    with pytest.raises(ConfigurationError, match="cannot be read on"):
        read(tmp_path / "bag")
