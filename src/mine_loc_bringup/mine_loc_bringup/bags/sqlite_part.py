"""One SQLite file that is whole after each flush: rows wait in memory and go in by one transaction."""

import contextlib
import errno
import sqlite3
from pathlib import Path
from typing import Any, ClassVar

from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer

from mine_loc_bringup.bags.topic import BagTopic

_ROW_BYTES = 32  # of a message, beside its data
_FULL = sqlite3.SQLITE_FULL
_ADD_TOPIC = "INSERT INTO topics VALUES(?, ?, ?, ?, ?, ?)"
_ADD_DEFINITION = (
    "INSERT INTO message_definitions (topic_type, encoding, encoded_message_definition, type_description_hash) "
    "VALUES(?, ?, ?, ?)"
)
_ADD_MESSAGE = "INSERT INTO messages (topic_id, timestamp, data) VALUES(?, ?, ?)"


class SqlitePart:
    """A part of a bag being written; the promises are those of McapPart.

    A write-ahead log holds what is not in the file yet, so that the file alone is never torn; `close` leaves the file
    alone.
    """

    suffix: ClassVar[str] = ".db3"

    def __init__(self, path: Path) -> None:
        with _as_os_errors(), contextlib.ExitStack() as undo:
            self._database = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
            undo.callback(self._database.close)
            self._database.execute("PRAGMA journal_mode=WAL")
            self._database.execute("PRAGMA synchronous=FULL")
            self._database.executescript(Sqlite3Writer.SQLITE_SCHEMA)
            undo.pop_all()
        self._types: set[str] = set()
        self._topics = 0
        self._pending: list[tuple[str, tuple[Any, ...]]] = []
        self._messages: list[tuple[int, int, bytes]] = []
        self.pending_bytes = 0
        """Bytes that `flush` would write."""

    @property
    def size_bytes(self) -> int:
        """Bytes of the file, with what is pending."""
        pages, page = (self._database.execute(f"PRAGMA {name}").fetchone()[0] for name in ("page_count", "page_size"))
        return int(pages * page) + self.pending_bytes

    def add_topic(self, topic: BagTopic) -> int:
        """Declare a topic; its number in this part."""
        if topic.msgtype not in self._types:
            self._types.add(topic.msgtype)
            row: tuple[Any, ...] = (topic.msgtype, topic.definition_encoding, topic.definition, topic.type_hash)
            self._pending.append((_ADD_DEFINITION, row))
        self._topics += 1
        row = (self._topics, topic.name, topic.msgtype, topic.encoding, topic.qos_text, topic.type_hash)
        self._pending.append((_ADD_TOPIC, row))
        self.pending_bytes += _ROW_BYTES + len(topic.definition)
        return self._topics

    def append(self, number: int, stamp_ns: int, data: bytes | memoryview) -> None:
        """Take a message of a topic's number; it is in memory until `flush`."""
        self._messages.append((number, stamp_ns, bytes(data)))
        self.pending_bytes += _ROW_BYTES + len(data)

    def flush(self) -> None:
        """Write what is pending in one transaction, and see it on the disk."""
        if not self.pending_bytes:
            return
        with _as_os_errors():
            self._database.execute("BEGIN")
            try:
                for statement, row in self._pending:
                    self._database.execute(statement, row)
                self._database.executemany(_ADD_MESSAGE, self._messages)
                self._database.execute("COMMIT")
            except sqlite3.Error:
                if self._database.in_transaction:
                    self._database.execute("ROLLBACK")
                raise
        self._pending, self._messages, self.pending_bytes = [], [], 0

    def close(self) -> None:
        """Flush, and put the log into the file; nothing can be appended afterwards."""
        self.flush()
        with _as_os_errors():
            self._database.execute("PRAGMA journal_mode=DELETE")
            self._database.close()

    def abandon(self) -> None:
        """Let go of the file as it is, without what is pending."""
        with contextlib.suppress(sqlite3.Error):
            self._database.close()


@contextlib.contextmanager
def _as_os_errors() -> Any:
    """A database that cannot be written raises what a file would."""
    try:
        yield
    except sqlite3.Error as error:
        number = errno.ENOSPC if getattr(error, "sqlite_errorcode", 0) & 0xFF == _FULL else errno.EIO
        raise OSError(number, str(error)) from error
