"""From rows that come to rows that stay: gathered, written in batches, spooled while the database does not take them.

A row is acknowledged once the batch it is in is committed, to the database or to the spool; `acknowledged` counts such
rows. From then on neither an end of the process, however sudden, nor a failing database loses it. What is not
acknowledged yet waits in memory, of which there is a limit.
"""

import threading
import uuid
import zlib
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

from mine_loc_bringup.store.batch import Batch
from mine_loc_bringup.store.records import Record
from mine_loc_bringup.store.spool import Spool, SpoolFullError
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_S

_RETRY_NS = 2 * NS_PER_S


class DatabaseUnavailableError(Exception):
    """The database does not take a batch now; the words say why."""


class Database(Protocol):
    """Where batches end up."""

    def write(self, batch: Batch, now_ns: int) -> None:
        """Commit a batch once, however often it is given. Raises DatabaseUnavailableError."""


@dataclass(slots=True)
class Counts:
    """Rows since the start."""

    acknowledged: int = 0
    spooled: int = 0
    """Of those acknowledged, by way of the spool."""
    lost: int = 0
    """Never acknowledged: neither database nor spool nor memory had room."""


class Keeper:
    """`put` is for the thread that hears, `flush` for the one that writes."""

    def __init__(
        self,
        database: Database,
        spool: Spool,
        arrange: Callable[[Sequence[Record]], list[Record]],
        most_rows: int,
        batch_rows: int,
    ) -> None:
        """`arrange` completes the records of a batch.

        Raises ConfigurationError where the spool holds what this version cannot read.
        """
        self._database, self._spool, self._arrange = database, spool, arrange
        self._most_rows, self._batch_rows = most_rows, batch_rows
        self._queue: deque[Record] = deque()
        self._writer, self._number = uuid.uuid4().hex, 0
        self._held: Batch | None = None
        self._retry_ns: int | None = None
        self._lock = threading.Lock()
        self.counts = Counts()
        self.database_problem = ""
        """Why the database takes nothing, empty while it does."""
        self.spool_problem = ""
        """Why the spool takes nothing, empty while it does."""
        if len(spool):
            self._first()

    @property
    def waiting(self) -> int:
        """Rows in memory, not acknowledged."""
        held = self._held
        return len(self._queue) + (len(held) if held else 0)

    @property
    def spooled_batches(self) -> int:
        """Batches that wait in the spool."""
        return len(self._spool)

    def put(self, records: Iterable[Record]) -> None:
        """Take rows; the newest are lost where there is no room."""
        for record in records:
            if len(self._queue) < self._most_rows:
                self._queue.append(record)
            else:
                self.counts.lost += 1

    def flush(self, now_ns: int, steady_ns: int) -> None:
        """Acknowledge what waits, as far as that goes."""
        with self._lock:
            while len(self._spool) and self._written(self._first(), now_ns, steady_ns):
                self._spool.drop_first()
            while (batch := self._next()) and self._acknowledge(batch, now_ns, steady_ns):
                self._held = None

    def close(self, now_ns: int, steady_ns: int) -> None:
        """Acknowledge what waits and let go of the spool."""
        self.flush(now_ns, steady_ns)
        with self._lock:
            self._spool.close()

    def _next(self) -> Batch | None:
        if self._held is None and self._queue:
            taken = [self._queue.popleft() for _ in range(min(self._batch_rows, len(self._queue)))]
            self._number += 1
            self._held = Batch.of(self._writer, self._number, self._arrange(taken))
        return self._held

    def _acknowledge(self, batch: Batch, now_ns: int, steady_ns: int) -> bool:
        if len(self._spool) or not self._written(batch, now_ns, steady_ns):  # a writer's batches go in by their order
            try:
                self._spool.append(batch.to_bytes())
            except (OSError, SpoolFullError) as error:
                self.spool_problem = str(error)
                return False
            self.counts.spooled += len(batch)
        self.spool_problem = ""
        self.counts.acknowledged += len(batch)
        return True

    def _written(self, batch: Batch, now_ns: int, steady_ns: int) -> bool:
        if self._retry_ns is not None and steady_ns < self._retry_ns:
            return False
        try:
            self._database.write(batch, now_ns)
        except DatabaseUnavailableError as error:
            self.database_problem, self._retry_ns = str(error), steady_ns + _RETRY_NS
            return False
        self.database_problem, self._retry_ns = "", None
        return True

    def _first(self) -> Batch:
        try:
            return Batch.from_bytes(self._spool.first())
        except (ValueError, TypeError, KeyError, zlib.error) as error:
            raise ConfigurationError(
                f"spool: {error!r}: written by another version; allowed: to empty it with that version"
            ) from error
