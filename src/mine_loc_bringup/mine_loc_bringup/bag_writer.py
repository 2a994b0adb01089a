"""Writing serialised ROS messages to a bag (rosbag2, MCAP) without a ROS installation's rosbag2."""

from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.rosbag2 import StoragePlugin, Writer

from mine_loc_bringup.message_types import type_name, workspace_types


class BagWriter:
    """A bag being written; connections are made as topics appear. Not for use by several threads."""

    def __init__(self, path: Path) -> None:
        self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        self._connections: dict[str, Connection] = {}

    def write(self, topic: str, kind: type | str, stamp_ns: int, data: bytes) -> None:
        """Write one serialised message of a rclpy message class, or of a type by name."""
        name = topic if topic.startswith("/") else f"/{topic}"
        connection = self._connections.get(name)
        if connection is None:
            msgtype = kind if isinstance(kind, str) else type_name(kind)
            connection = self._writer.add_connection(name, msgtype, typestore=workspace_types())
            self._connections[name] = connection
        self._writer.write(connection, stamp_ns, data)

    def close(self) -> None:
        """Finish the bag; nothing can be written afterwards."""
        self._writer.close()
