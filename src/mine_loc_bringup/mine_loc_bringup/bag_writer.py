"""Writing serialised ROS messages to a bag (rosbag2, MCAP) without a ROS installation's rosbag2."""

from pathlib import Path

from mine_loc_bringup.bags.bag_folder import BagFolder
from mine_loc_bringup.bags.message_definitions import MessageDefinitions
from mine_loc_bringup.bags.topic import BagTopic
from mine_loc_bringup.message_types import type_name

_FLUSH_BYTES = 4 << 20


class BagWriter:
    """A bag being written; topics are declared as they appear. Not for use by several threads."""

    def __init__(self, path: Path) -> None:
        self._definitions = MessageDefinitions()
        self._bag = BagFolder(path)
        self._names: dict[str, str] = {}

    def write(self, topic: str, kind: type | str, stamp_ns: int, data: bytes) -> None:
        """Write one serialised message of a rclpy message class, or of a type by name."""
        name = self._names.get(topic) or self._declare(topic, kind)
        self._bag.write(name, stamp_ns, data)
        if self._bag.pending_bytes >= _FLUSH_BYTES:
            self._bag.flush()

    def close(self) -> None:
        """Finish the bag; nothing can be written afterwards."""
        self._bag.close()

    def _declare(self, topic: str, kind: type | str) -> str:
        name = self._names[topic] = topic if topic.startswith("/") else f"/{topic}"
        msgtype = kind if isinstance(kind, str) else type_name(kind)
        definition, type_hash = self._definitions.find(msgtype)
        self._bag.add_topic(BagTopic(name, msgtype, definition, type_hash))
        return name
