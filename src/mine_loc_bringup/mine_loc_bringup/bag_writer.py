"""Writing serialised ROS messages to a bag (rosbag2, MCAP) without a ROS installation's rosbag2."""

from importlib import import_module
from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.interfaces.typing import Typesdict
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore


class BagWriter:
    """A bag being written; connections are made as topics appear. Not for use by several threads."""

    def __init__(self, path: Path) -> None:
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        self._connections: dict[str, Connection] = {}

    def write(self, topic: str, kind: type, stamp_ns: int, data: bytes) -> None:
        """Write one serialised message of a rclpy message class."""
        name = topic if topic.startswith("/") else f"/{topic}"
        connection = self._connections.get(name)
        if connection is None:
            connection = self._writer.add_connection(name, self._type_name(kind), typestore=self._types)
            self._connections[name] = connection
        self._writer.write(connection, stamp_ns, data)

    def close(self) -> None:
        """Finish the bag; nothing can be written afterwards."""
        self._writer.close()

    def _type_name(self, kind: type) -> str:
        package = kind.__module__.split(".", 1)[0]
        name = f"{package}/msg/{kind.__name__}"
        if name not in self._types.fielddefs:
            self._types.register(_definitions(package))
        return name


def _definitions(package: str) -> Typesdict:
    """All message definitions of a package that this workspace brings, from the text it installs."""
    root = Path(str(import_module(package).__file__))
    folder = next(
        parent / "share" / package / "msg" for parent in root.parents if (parent / "share" / package).is_dir()
    )
    definitions: Typesdict = {}
    for file in sorted(folder.glob("*.msg")):
        definitions.update(get_types_from_msg(file.read_text("utf-8"), f"{package}/msg/{file.stem}"))
    return definitions
