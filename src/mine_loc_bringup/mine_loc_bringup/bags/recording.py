"""A bag written beside the work that makes its messages: a bounded queue, and a thread that flushes twice a second."""

import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from mine_loc_bringup.bags.bag_folder import BagFolder
from mine_loc_bringup.bags.topic import BagTopic

FLUSH_PERIOD_S = 0.5
"""Half of what a crash may cost: a flush and the queue before it have the other half."""

_MOST_PENDING_BYTES = 4 << 20  # a chunk, and a transaction, at most
_POLL_S = 0.02
_LONGEST_END_S = 10.0


@dataclass(frozen=True, slots=True)
class RecordingStatus:
    """Where a recording stands; `problem` is empty, or why nothing reaches the disk right now."""

    messages: int
    topics: int
    parts: int
    size_bytes: int
    dropped: int
    problem: str


class Recording:
    """Messages offered by one thread reach a bag in the order offered. `offer` never waits.

    Where the disk takes no more, messages wait in the queue until it does; those that find the queue full are counted
    as dropped. The thread owns the bag.
    """

    def __init__(self, bag: BagFolder, queue_bytes: int) -> None:
        self._bag = bag
        self._queue_bytes = queue_bytes
        self._queue: deque[tuple[str, int, bytes] | BagTopic | None] = deque()  # None asks for a new part
        self._offered_bytes = 0  # by the thread that offers
        self._taken_bytes = 0  # by the thread that writes
        self._dropped = 0
        self._problem = ""
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._write, daemon=True, name="recording")
        self._thread.start()

    def add_topic(self, topic: BagTopic) -> None:
        """Declare a topic before its first message."""
        self._queue.append(topic)

    def offer(self, topic: str, stamp_ns: int, data: bytes) -> None:
        """Take a message, or count it as dropped."""
        if self._offered_bytes - self._taken_bytes + len(data) > self._queue_bytes:
            self._dropped += 1
            return
        self._offered_bytes += len(data)
        self._queue.append((topic, stamp_ns, data))

    def split(self) -> None:
        """Begin a new part with the next message."""
        self._queue.append(None)

    @property
    def status(self) -> RecordingStatus:
        """As of now."""
        bag, problem = self._bag, self._problem
        if not self._thread.is_alive() and not self._stop.is_set():
            problem = f"{bag.path}: the thread that writes has ended"
        return RecordingStatus(bag.messages, bag.topics, bag.parts, self._taken_bytes, self._dropped, problem)

    def close(self) -> RecordingStatus:
        """Write what is queued and end the bag; where the disk refuses, the status says so and `repair` opens it."""
        self._stop.set()
        self._thread.join(_LONGEST_END_S)
        return self.status

    def _write(self) -> None:
        flush_at_s = time.monotonic() + FLUSH_PERIOD_S
        while not self._stop.wait(_POLL_S):
            if not self._problem:
                self._drain()
            if time.monotonic() >= flush_at_s:
                self._attempt(self._bag.flush)
                flush_at_s = time.monotonic() + FLUSH_PERIOD_S
        self._attempt(self._bag.flush)
        self._drain()
        if not self._problem:
            self._attempt(self._bag.close)
        if self._problem:
            self._bag.abandon()

    def _drain(self) -> None:
        """Move the queue into the bag, as far as the disk follows."""
        while self._queue and not self._problem:
            if self._bag.pending_bytes >= _MOST_PENDING_BYTES:
                self._attempt(self._bag.flush)
                continue
            item = self._queue.popleft()
            if item is None:
                self._attempt(self._bag.split)
            elif isinstance(item, BagTopic):
                self._bag.add_topic(item)
            else:
                self._bag.write(*item)
                self._taken_bytes += len(item[2])

    def _attempt(self, step: Callable[[], None]) -> None:
        try:
            step()
        except OSError as error:
            self._problem = f"{self._bag.path}: {error.strerror}"
        else:
            self._problem = ""
