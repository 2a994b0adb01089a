"""A bag to be played: its topics, and its messages read ahead of need by a thread, in order of time."""

import queue
import threading
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader, ReaderError

from mine_loc_core.errors import ConfigurationError

_READ_AHEAD = 2000
_POLL_S = 0.1
Entry = tuple[Connection, int, bytes]


class BagReader:
    """An open rosbag2 bag. Raises ConfigurationError for what is none, or has no end."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._reader = Reader(path)
            self._reader.open()
        except (ReaderError, OSError, ValueError, KeyError, IndexError, TypeError) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise ConfigurationError(
                f"{path}: cannot be read as a bag: {reason}; where it is one, mine-loc bag repair {path} OUT opens "
                "what is left"
            ) from None
        self.connections: Collection[Connection] = tuple(self._reader.connections)
        self.start_ns = self._reader.start_time
        self.stop_ns = self._reader.end_time - 1
        """Times of the first and the last message."""

    def close(self) -> None:
        """Close the files."""
        self._reader.close()

    def messages(self, connections: Collection[Connection], start_ns: int) -> "ReadAhead":
        """Connection, time and serialised data from a time on; nothing else may be read before that is closed."""
        return ReadAhead(self._reader.messages(connections, start=start_ns))

    def latched_before(self, connections: Iterable[Connection], depths: Mapping[str, int], stop_ns: int) -> list[Entry]:
        """What a subscriber that came at this time would have of latched topics: by topic, so many messages."""
        kept: dict[str, deque[Entry]] = {topic: deque(maxlen=depth) for topic, depth in depths.items()}
        latched = [connection for connection in connections if connection.topic in kept]
        if latched:
            for entry in self._reader.messages(latched, stop=stop_ns):
                kept[entry[0].topic].append(entry)
        return [entry for entries in kept.values() for entry in entries]


class ReadAhead:
    """Entries that a thread takes from an iterator, at most _READ_AHEAD before they are asked for."""

    def __init__(self, entries: Iterator[Entry]) -> None:
        self._entries = entries
        self._waiting: queue.Queue[Entry | Exception | None] = queue.Queue(_READ_AHEAD)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._read, daemon=True, name="read ahead")
        self._thread.start()

    def __iter__(self) -> Iterator[Entry]:
        """Raises ConfigurationError where the bag is damaged, after the entries before."""
        while (item := self._waiting.get()) is not None:
            if isinstance(item, Exception):
                raise ConfigurationError(f"it cannot be read on ({item}); mine-loc bag repair opens what is left")
            yield item

    def close(self) -> None:
        """End the thread."""
        self._over.set()
        self._thread.join()

    def _read(self) -> None:
        try:
            for entry in self._entries:
                self._put(entry)
                if self._over.is_set():
                    return
            self._put(None)
        except Exception as error:  # noqa: BLE001 readers raise what they like of a damaged file
            self._put(error)

    def _put(self, item: Entry | Exception | None) -> None:
        while not self._over.is_set():
            try:
                self._waiting.put(item, timeout=_POLL_S)
            except queue.Full:
                continue
            return
