"""What is left of a SQLite file: the rows that its own recovery, and then its pages, still give."""

import contextlib
import os
import shutil
import sqlite3
import struct
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from mine_loc_bringup.bags.mcap_salvage import qos_of
from mine_loc_bringup.bags.message_definitions import MessageDefinitions, type_hash
from mine_loc_bringup.bags.topic import BagTopic
from mine_loc_core.errors import ConfigurationError

_MAGIC = b"SQLite format 3\0"
_HEADER = struct.Struct(">16sH10xI")  # magic, bytes of a page (1 = 65536), number of pages
_LARGEST_PAGE = 65536
_LEAST_OVERFLOW_BYTES = 400  # of a row that spreads over pages, for the smallest pages of 512 bytes
_MOST_ON_A_PAGE = 16  # of such rows
_MESSAGES = "SELECT topic_id, timestamp, data FROM messages ORDER BY id"
_COMPANIONS = ("", "-wal", "-journal")


@dataclass(slots=True)
class SqliteSalvage:
    """Reads a copy of a file with its log, made in `workplace`: recovery writes, and what is left is evidence."""

    path: Path
    workplace: Path
    topics: dict[int, BagTopic] = field(default_factory=dict)
    lost_bytes: int = 0
    problem: str = ""

    def messages(self) -> Iterator[tuple[int, int, bytes]]:
        """Number of the topic in `topics`, time [ns] and serialised data, in the order they were written."""
        copy = self.workplace / self.path.name
        for companion in _COMPANIONS:
            source = self.path.with_name(self.path.name + companion)
            if source.exists():
                shutil.copyfile(source, copy.with_name(copy.name + companion))
        _give_full_length(copy)
        with contextlib.closing(sqlite3.connect(copy)) as database:
            held: deque[tuple[int, int, bytes]] = deque()
            read = 0
            try:
                self._read_topics(database)
                for number, stamp_ns, data in database.execute(_MESSAGES):
                    if number in self.topics and isinstance(data, bytes) and stamp_ns >= 0:
                        held.append((number, stamp_ns, data))
                    if len(held) > _MOST_ON_A_PAGE:
                        read += len(held[0][2])
                        yield held.popleft()
            except sqlite3.Error as error:
                self.problem = f"it cannot be read to its end ({error})"
                self.lost_bytes = max(0, self.path.stat().st_size - read)
                held = deque(row for row in held if not _may_lack_its_end(row[2]))
            yield from held

    def _read_topics(self, database: sqlite3.Connection) -> None:
        database.row_factory = sqlite3.Row
        installed = MessageDefinitions()
        tables = {row["name"] for row in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        definitions: dict[str, tuple[str, str]] = {}
        if "message_definitions" in tables:
            for row in database.execute("SELECT * FROM message_definitions"):
                definitions[row["topic_type"]] = (row["encoded_message_definition"], row["encoding"])
        for row in database.execute("SELECT * FROM topics"):
            columns = dict(row)
            kind = columns["type"]
            text, encoding = definitions.get(kind) or (_installed(installed, kind), "ros2msg")
            self.topics[columns["id"]] = BagTopic(
                name=columns["name"],
                msgtype=kind,
                definition=text,
                type_hash=columns.get("type_description_hash") or type_hash(kind, text),
                qos=qos_of(columns.get("offered_qos_profiles", "")),
                encoding=columns["serialization_format"],
                definition_encoding=encoding,
            )
        database.row_factory = None


def _give_full_length(file: Path) -> None:
    """Put empty pages where a file was cut: SQLite opens none that is shorter than its header says."""
    with file.open("rb") as opened:
        header = opened.read(_HEADER.size)
    if len(header) < _HEADER.size:
        return
    magic, page_bytes, pages = _HEADER.unpack(header)
    page_bytes = page_bytes if page_bytes > 1 else _LARGEST_PAGE
    size = file.stat().st_size
    if magic == _MAGIC and size < pages * page_bytes:
        os.truncate(file, size - size % page_bytes)
        os.truncate(file, pages * page_bytes)


def _may_lack_its_end(data: bytes) -> bool:
    """Whether a row near the cut may have its last overflow page beyond it, and hence zeros for its end."""
    return len(data) > _LEAST_OVERFLOW_BYTES and data[-1] == 0


def _installed(definitions: MessageDefinitions, kind: str) -> str:
    """The definition of a type from what is installed, for bags of a time before they held definitions."""
    try:
        return definitions.find(kind)[0]
    except ConfigurationError:
        return ""
