"""Bags of numbered strings, and what readers that are not ours find in them."""

from pathlib import Path

from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

from mine_loc_bringup.bags.bag_folder import BagFolder, SplitLimits, Storage
from mine_loc_bringup.bags.message_definitions import MessageDefinitions
from mine_loc_bringup.bags.topic import BagTopic

STRING = "std_msgs/msg/String"
DEFINITION, HASH = MessageDefinitions().find(STRING)
FOREVER = QosTime(9223372036, 854775807)
LATCHED_QOS = Qos(
    QosHistory.KEEP_LAST,
    1,
    QosReliability.RELIABLE,
    QosDurability.TRANSIENT_LOCAL,
    FOREVER,
    FOREVER,
    QosLiveliness.AUTOMATIC,
    FOREVER,
    avoid_ros_namespace_conventions=False,
)


def string_topic(name: str, latched_depth: int = 0) -> BagTopic:
    return BagTopic(name, STRING, DEFINITION, HASH, (LATCHED_QOS,) if latched_depth else (), latched_depth)


def string_cdr(text: str) -> bytes:
    data = text.encode() + b"\0"
    return b"\0\1\0\0" + len(data).to_bytes(4, "little") + data


def new_bag(path: Path, storage: Storage = Storage.MCAP, limits: SplitLimits | None = None) -> BagFolder:
    bag = BagFolder(path, storage, limits)
    bag.add_topic(string_topic("/count"))
    return bag


def write_counts(bag: BagFolder, first: int, last: int) -> None:
    for number in range(first, last):
        bag.write("/count", number, string_cdr(str(number)))


def read_with_rosbags(*paths: Path) -> list[tuple[str, int, str]]:
    with AnyReader(list(paths)) as reader:
        return [(c.topic, stamp, reader.deserialize(raw, c.msgtype).data) for c, stamp, raw in reader.messages()]


def read_with_mcap(file: Path) -> list[tuple[str, int, bytes]]:
    with file.open("rb") as stream:
        messages = make_reader(stream, validate_crcs=True).iter_messages()
        return [(channel.topic, message.log_time, message.data) for _, channel, message in messages]


def counts_of(path: Path) -> list[int]:
    return [int(text) for topic, _, text in read_with_rosbags(path) if topic == "/count"]
