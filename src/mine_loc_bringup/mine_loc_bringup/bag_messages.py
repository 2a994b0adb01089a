"""Messages of a bag, of any rosbag2 or ROS 1 recorder, in the order recorded and in our definitions."""

import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rosbags.highlevel import AnyReader, AnyReaderError
from rosbags.interfaces import Connection

from mine_loc_bringup.message_types import workspace_types
from mine_loc_bringup.topic_mapping import TopicMapping, adapt
from mine_loc_core.errors import ConfigurationError

BROKEN = (
    AnyReaderError,
    OSError,
    ValueError,
    LookupError,
    AttributeError,
    TypeError,
    EOFError,
    AssertionError,
    struct.error,
)
"""What the reader of rosbags raises on files that are broken off or are no bags."""


@dataclass(frozen=True, slots=True)
class BagMessage:
    """One message: recorded at `log_ns`, CDR in the definitions of this workspace."""

    log_ns: int
    topic: str
    type_name: str
    data: bytes


class BagMessages:
    """An open bag."""

    def __init__(self, reader: AnyReader, bag: Path, mapping: TopicMapping) -> None:
        self._reader, self._bag, self._mapping = reader, bag, mapping
        self._types = workspace_types()
        held = reader.message_count
        self.start_ns, self.end_ns = (reader.start_time, reader.end_time) if held else (0, 0)

    @property
    def topics(self) -> dict[str, str]:
        """Topic → type, after the mapping; what has a type that this workspace does not know is left out."""
        targets = [self._mapping.target(each.topic, each.msgtype) for each in self._reader.connections]
        return {topic: name for topic, name in targets if name in self._types.fielddefs}

    def read(self, wanted: set[str]) -> Iterator[BagMessage]:
        """Messages of the wanted topics (names after the mapping), in the order of their recording.

        Raises ConfigurationError where the bag breaks off or a message is not what its definition says.
        """
        targets = {each.id: self._mapping.target(each.topic, each.msgtype) for each in self._reader.connections}
        chosen = [each for each in self._reader.connections if targets[each.id][0] in wanted]
        convert = {each.id: self._converter(each, targets[each.id][1]) for each in chosen}
        try:
            for connection, log_ns, raw in self._reader.messages(chosen) if chosen else ():
                topic, name = targets[connection.id]
                yield BagMessage(log_ns, topic, name, convert[connection.id](raw, log_ns))
        except BROKEN as error:
            raise ConfigurationError(f"{self._bag}: cannot be read on: {error}; allowed: a whole bag") from error

    def _converter(self, connection: Connection, name: str) -> Callable[[bytes, int], bytes]:
        fields = self._mapping.fields(connection.topic)
        same = name in self._types.fielddefs and connection.digest == self._types.hash_rihs01(name)
        if fields is None and self._reader.is2 and same:
            return lambda raw, _: bytes(raw)

        def convert(raw: bytes, log_ns: int) -> bytes:
            source: Any = self._reader.deserialize(raw, connection.msgtype)
            return bytes(self._types.serialize_cdr(adapt(source, name, self._types, fields, log_ns), name))

        return convert


@contextmanager
def open_bag(bag: Path, mapping: TopicMapping | None = None) -> Iterator[BagMessages]:
    """Open a bag: a folder of rosbag2, an .mcap or .db3 file in it, or a .bag file of ROS 1.

    Raises ConfigurationError for what is none.
    """
    try:
        reader = AnyReader([bag], default_typestore=workspace_types())
        reader.open()
    except BROKEN as error:
        reason = str(error) or type(error).__name__
        raise ConfigurationError(
            f"{bag}: {reason}; allowed: a folder of rosbag2 or a .bag file (mine-loc bag repair mends a broken one)"
        ) from error
    try:
        yield BagMessages(reader, bag, mapping or TopicMapping({}))
    finally:
        reader.close()
