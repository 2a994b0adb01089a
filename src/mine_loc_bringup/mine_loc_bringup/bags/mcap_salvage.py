"""What is left of an MCAP file: every whole record from its beginning on, without need of an index or an end."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Schema
from mcap.writer import MCAP0_MAGIC
from rosbags.interfaces import Qos
from rosbags.rosbag2 import ReaderError
from rosbags.rosbag2.metadata import parse_qos
from rosbags.rosbag2.storage_mcap import decompress

from mine_loc_bringup.bags.message_definitions import type_hash
from mine_loc_bringup.bags.topic import BagTopic

_HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_CHUNK = struct.Struct("<QQQI")  # times, uncompressed size, CRC
_CHUNK_TAIL = struct.Struct("<IQ")  # then length of the compression's name, which is empty, and of the records
_DATA_END_BYTES = 4
_LARGEST_CHUNK = 1 << 30
_WRONG_LENGTH = "it has a chunk whose length is not what was written"


@dataclass(slots=True)
class McapSalvage:
    """Reads a file as far as it goes; afterwards `lost_bytes` says how much of it made no sense, and `problem` why."""

    data: memoryview
    topics: dict[int, BagTopic] = field(default_factory=dict)
    lost_bytes: int = 0
    problem: str = ""
    _schemas: dict[int, Schema] = field(default_factory=dict)

    def messages(self) -> Iterator[tuple[int, int, memoryview]]:
        """Number of the topic in `topics`, log time [ns] and serialised data, in the order of the file."""
        if bytes(self.data[: len(MCAP0_MAGIC)]) != MCAP0_MAGIC:
            self._lose(len(self.data), "it does not begin as an MCAP file")
            return
        for opcode, content, whole in self._records(self.data[len(MCAP0_MAGIC) :]):
            if opcode == Opcode.DATA_END and len(content) == _DATA_END_BYTES:
                return
            if opcode == Opcode.CHUNK:
                yield from self._chunk(content, whole=whole)
            elif whole and opcode != Opcode.DATA_END:
                yield from self._record(opcode, content)
            else:
                self._lose(len(content), "it ends within a record, or has one that is not what was written")

    def _records(self, data: memoryview) -> Iterator[tuple[int, memoryview, bool]]:
        """Opcode, content and whether all of the content is there, of one record after the other."""
        position = 0
        while position < len(data):
            if position + _HEAD.size > len(data):
                self._lose(len(data) - position, "it ends within a record")
                return
            opcode, length = _HEAD.unpack_from(data, position)
            if opcode == 0:
                self._lose(len(data) - position, "it goes on with what is no record")
                return
            content = data[position + _HEAD.size : position + _HEAD.size + length]
            yield opcode, content, len(content) == length
            position += _HEAD.size + length

    def _chunk(self, content: memoryview, *, whole: bool) -> Iterator[tuple[int, int, memoryview]]:
        inner = self._unpacked(content) if whole else self._torn(content)
        if inner is None:
            self._lose(len(content), self.problem or "it has a chunk that is not what was written")
            return
        for opcode, record, complete in self._records(inner):
            if complete:
                yield from self._record(opcode, record)
            else:
                self._lose(len(record), "it ends within a record")

    def _unpacked(self, content: memoryview) -> memoryview | None:
        """The records of a whole chunk; None where its size or checksum is wrong."""
        try:
            chunk = Chunk.read(ReadDataStream(BytesIO(content)))
            if chunk.uncompressed_size > _LARGEST_CHUNK:
                return None
            size, crc = chunk.uncompressed_size, chunk.uncompressed_crc
            beyond = len(content) - _CHUNK.size - _CHUNK_TAIL.size - len(chunk.compression) - len(chunk.data)
            if beyond:
                self._lose(beyond, _WRONG_LENGTH)
            return memoryview(decompress(chunk.data, chunk.compression, size, crc))
        except Exception as error:  # noqa: BLE001 each compressor raises what it likes
            self.problem = f"it has a chunk that is not what was written ({error})"
            return None

    def _torn(self, content: memoryview) -> memoryview | None:
        """What is there of the records of a chunk that was cut, if they are not compressed."""
        if len(content) < _CHUNK.size + _CHUNK_TAIL.size:
            return content[:0]
        name_length, size = _CHUNK_TAIL.unpack_from(content, _CHUNK.size)
        if name_length:
            self.problem = "it ends within a compressed chunk"
            return None
        records = content[_CHUNK.size + _CHUNK_TAIL.size :]
        if size != len(records):
            self._lose(abs(size - len(records)), "it ends within a chunk" if size > len(records) else _WRONG_LENGTH)
        return records[:size]

    def _record(self, opcode: int, content: memoryview) -> Iterator[tuple[int, int, memoryview]]:
        try:
            if opcode == Opcode.SCHEMA:
                schema = Schema.read(ReadDataStream(BytesIO(content)))
                self._schemas[schema.id] = schema
            elif opcode == Opcode.CHANNEL:
                self._declare(Channel.read(ReadDataStream(BytesIO(content))))
            elif opcode == Opcode.MESSAGE:
                number, _, log_ns, _ = _MESSAGE.unpack_from(content)
                if number in self.topics:
                    yield number, log_ns, content[_MESSAGE.size :]
                else:
                    self._lose(len(content), "a message belongs to no topic")
        except (McapError, struct.error, UnicodeDecodeError) as error:
            self._lose(len(content), f"a record cannot be read ({error})")

    def _declare(self, channel: Channel) -> None:
        schema = self._schemas.get(channel.schema_id)
        if schema is None or channel.id in self.topics:
            return
        text = schema.data.decode("utf-8")
        self.topics[channel.id] = BagTopic(
            name=channel.topic,
            msgtype=schema.name,
            definition=text,
            type_hash=channel.metadata.get("topic_type_hash") or type_hash(schema.name, text),
            qos=qos_of(channel.metadata.get("offered_qos_profiles", "")),
            encoding=channel.message_encoding,
            definition_encoding=schema.encoding,
        )

    def _lose(self, count: int, problem: str) -> None:
        self.lost_bytes += count
        self.problem = problem


def qos_of(text: str) -> tuple[Qos, ...]:
    """The profiles of a topic from the text that rosbag2 stores; none where it is not such a text."""
    try:
        return tuple(parse_qos(text))
    except (ReaderError, KeyError, TypeError):
        return ()
