"""One MCAP file that is whole after each flush: chunks are built in memory and reach the disk entire or not at all.

Layout after the MCAP specification: chunks with CRC and message indexes, then the summary. A file without summary is
what a crash leaves; it reads from its beginning to the end of its last chunk.
"""

import os
import struct
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import ClassVar

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Schema,
    Statistics,
)
from mcap.writer import MCAP0_MAGIC

from mine_loc_bringup.bags.topic import BagTopic

_MESSAGE = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time
_HEAD_BYTES = 22  # of a message, before its data
_INDEX = struct.Struct("<BQHI")  # opcode, length, channel, length of the entries
_FOOTER = struct.Struct("<BQQQ")


class McapPart:
    """A part of a bag being written. What `flush` returned from survives a power cut.

    `flush` and `close` raise OSError where the disk takes no more; the file then ends where it ended before, nothing
    that was appended is forgotten, and they may be called again.
    """

    suffix: ClassVar[str] = ".mcap"

    def __init__(self, path: Path) -> None:
        self._file = path.open("xb", buffering=0)
        self._end = 0
        self._schemas: dict[str, Schema] = {}
        self._channels: list[Channel] = []
        self._counts: list[int] = []
        self._chunk = bytearray()
        self._entries: dict[int, list[int]] = {}  # of the chunk, by channel: log time, offset, log time, offset, …
        self._indexes: list[ChunkIndex] = []
        self._times: list[tuple[int, int]] = []
        self._write_out(MCAP0_MAGIC + _bytes([Header("ros2", "mine_loc")]))

    @property
    def pending_bytes(self) -> int:
        """Bytes that `flush` would write."""
        return len(self._chunk)

    @property
    def size_bytes(self) -> int:
        """Bytes of the file, with what is pending."""
        return self._end + len(self._chunk)

    def add_topic(self, topic: BagTopic) -> int:
        """Declare a topic; its number in this part."""
        schema = self._schemas.get(topic.msgtype)
        if schema is None:
            text = topic.definition.encode()
            schema = Schema(
                id=len(self._schemas) + 1, name=topic.msgtype, encoding=topic.definition_encoding, data=text
            )
            self._schemas[topic.msgtype] = schema
            self._chunk += _bytes([schema])
        channel = Channel(
            id=len(self._channels),
            topic=topic.name,
            message_encoding=topic.encoding,
            schema_id=schema.id,
            metadata={"offered_qos_profiles": topic.qos_text, "topic_type_hash": topic.type_hash},
        )
        self._channels.append(channel)
        self._counts.append(0)
        self._chunk += _bytes([channel])
        return channel.id

    def append(self, number: int, stamp_ns: int, data: bytes | memoryview) -> None:
        """Take a message of a topic's number; it is in memory until `flush`."""
        entries = self._entries.get(number)
        if entries is None:
            entries = self._entries[number] = []
        entries.append(stamp_ns)
        entries.append(len(self._chunk))
        self._chunk += _MESSAGE.pack(Opcode.MESSAGE, _HEAD_BYTES + len(data), number, 0, stamp_ns, stamp_ns)
        self._chunk += data

    def flush(self) -> None:
        """Write what is pending as a chunk, and see it on the disk."""
        if not self._chunk:
            return
        stamps = [stamp for entries in self._entries.values() for stamp in entries[::2]]
        first_ns, last_ns = (min(stamps), max(stamps)) if stamps else (0, 0)
        chunk = _bytes(
            [
                Chunk(
                    compression="",
                    data=bytes(self._chunk),
                    message_start_time=first_ns,
                    message_end_time=last_ns,
                    uncompressed_crc=zlib.crc32(self._chunk),
                    uncompressed_size=len(self._chunk),
                )
            ]
        )
        offsets, message_indexes = self._message_indexes(self._end + len(chunk))
        start = self._end
        self._write_out(chunk + message_indexes)
        self._indexes.append(
            ChunkIndex(
                chunk_start_offset=start,
                chunk_length=len(chunk),
                compression="",
                compressed_size=len(self._chunk),
                uncompressed_size=len(self._chunk),
                message_start_time=first_ns,
                message_end_time=last_ns,
                message_index_offsets=offsets,
                message_index_length=len(message_indexes),
            )
        )
        if stamps:
            self._times.append((first_ns, last_ns))
        for number, entries in self._entries.items():
            self._counts[number] += len(entries) // 2
        self._chunk = bytearray()
        self._entries = {}

    def close(self) -> None:
        """Flush, and write the summary; nothing can be appended afterwards."""
        self.flush()
        data_end = _bytes([DataEnd(0)])
        start = self._end + len(data_end)
        summary = _bytes([*self._schemas.values(), *self._channels, *self._indexes, self._statistics()])
        crc = zlib.crc32(_FOOTER.pack(Opcode.FOOTER, 20, start, 0), zlib.crc32(summary))
        footer = _bytes([Footer(summary_start=start, summary_offset_start=0, summary_crc=crc)])
        self._write_out(data_end + summary + footer + MCAP0_MAGIC)
        self._file.close()

    def abandon(self) -> None:
        """Let go of the file as it is, without what is pending."""
        self._file.close()

    def _message_indexes(self, position: int) -> tuple[dict[int, int], bytes]:
        """Where in the file the index of each channel will be, and all of them."""
        offsets, records = {}, bytearray()
        for number, entries in self._entries.items():
            offsets[number] = position + len(records)
            length = 8 * len(entries)
            records += _INDEX.pack(Opcode.MESSAGE_INDEX, 6 + length, number, length)
            records += struct.pack(f"<{len(entries)}Q", *entries)
        return offsets, bytes(records)

    def _statistics(self) -> Statistics:
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(enumerate(self._counts)),
            chunk_count=len(self._indexes),
            message_count=sum(self._counts),
            message_start_time=min((first for first, _ in self._times), default=0),
            message_end_time=max((last for _, last in self._times), default=0),
            metadata_count=0,
            schema_count=len(self._schemas),
        )

    def _write_out(self, data: bytes) -> None:
        """Put bytes at the end and see them on the disk; where that fails, the file is as before."""
        left = memoryview(data)
        try:
            while left:
                left = left[os.pwrite(self._file.fileno(), left, self._end + len(data) - len(left)) :]
            os.fsync(self._file.fileno())
        except OSError:
            os.ftruncate(self._file.fileno(), self._end)
            raise
        self._end += len(data)


def _bytes(records: Iterable[McapRecord]) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]
