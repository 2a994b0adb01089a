"""A serial line that may vanish: device, pty or TCP bridge, read into a bounded queue by the process's port reader.

The port is resolved anew at every connection, so a device that comes back under another name is found again:
a path, a glob pattern (`/dev/ttyACM*`), `socket://host:port`, or `hwgrep://VID:PID` (pyserial's URL handlers).
"""

import glob
import random
import termios
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import serial

from mine_loc_core.port_reader import port_reader

_FIRST_RETRY_S = 0.2
_LAST_RETRY_S = 2.0
_QUEUE_CHUNKS = 1024
_FAILURES = (OSError, ValueError, termios.error)  # of a port that is missing, busy, or goes while it is set up


@dataclass(frozen=True, slots=True)
class Chunk:
    """Bytes and the instant they were read, by the clock given to the link. No bytes = a new connection."""

    arrival_ns: int
    data: bytes


@dataclass(frozen=True, slots=True)
class LinkStatus:
    """State of the line: the port in use (empty = none), why it is down, and counters."""

    port: str
    error: str
    connections: int
    bytes_read: int
    bytes_dropped: int
    silent_s: float


class SerialLink:
    """Reads a port for ever: reconnects with back-off and jitter, never raises from its thread.

    `wake` is called after something was queued, from the thread of this link or of the port reader, never both at
    once. `silence_s` closes a line that was silent for so long, because a TCP bridge that lost power does not say so.
    """

    def __init__(
        self, port: str, baud: int, *, clock: Callable[[], int], wake: Callable[[], None], silence_s: float = 5.0
    ) -> None:
        self._pattern = port
        self._baud = baud
        self._clock = clock
        self._wake = wake
        self._silence_s = silence_s
        self._queue: deque[Chunk] = deque()
        self._queue_lock = threading.Lock()
        self._port_lock = threading.Lock()
        self._stopped = False
        self._woken = threading.Event()  # the link's thread: the port has failed, or is to be closed
        self._port: serial.SerialBase | None = None
        self._name = ""
        self._error = "not opened yet"
        self._connections = self._bytes_read = self._bytes_dropped = 0
        self._last_heard = time.monotonic()
        self._thread = threading.Thread(target=self._run, name=f"serial {port}", daemon=True)

    def start(self) -> None:
        """Start reading."""
        self._thread.start()

    def stop(self) -> None:
        """Stop reading and close the port; returns within a second."""
        self._stopped = True
        self._woken.set()
        if self._thread.is_alive():
            self._thread.join(timeout=1.0)

    def take(self) -> list[Chunk]:
        """All chunks since the last call, in order."""
        with self._queue_lock:
            chunks = list(self._queue)
            self._queue.clear()
        return chunks

    def write(self, data: bytes) -> None:
        """Send bytes to the device; a line that is down swallows them, as unplugged cables do."""
        with self._port_lock:
            if self._port is None or not data:
                return
            try:
                self._port.write(data)
            except _FAILURES as error:
                self._error = str(error)

    @property
    def status(self) -> LinkStatus:
        """State of the line now."""
        silent_s = time.monotonic() - self._last_heard
        return LinkStatus(self._name, self._error, self._connections, self._bytes_read, self._bytes_dropped, silent_s)

    def _run(self) -> None:
        retry_s = _FIRST_RETRY_S
        while not self._stopped:
            if self._open():
                retry_s = _FIRST_RETRY_S
                self._read_until_it_fails()
                self._close()
                self._woken.clear()
            if not self._stopped:
                self._woken.wait(retry_s * random.uniform(0.5, 1.0))  # noqa: S311 jitter, not a secret
            retry_s = min(2 * retry_s, _LAST_RETRY_S)

    def _open(self) -> bool:
        for name in self._candidates():
            try:
                self._port = serial.serial_for_url(name, self._baud, timeout=0, write_timeout=1.0, exclusive=True)
            except _FAILURES as error:
                self._error = str(error)
                continue
            self._name, self._error = name, ""
            self._connections += 1
            self._put(b"")
            return True
        return False

    def _candidates(self) -> list[str]:
        if "://" in self._pattern:
            return [self._pattern]
        names = sorted(glob.glob(self._pattern))  # noqa: PTH207 patterns are absolute
        if not names:
            self._error = f"no such port: {self._pattern}"
        return names

    def _read_until_it_fails(self) -> None:
        assert self._port is not None
        try:
            descriptor = self._port.fileno()
            port_reader().add(descriptor, self._put, self._fail)
        except _FAILURES as error:
            self._error = str(error)
            return
        while not self._woken.is_set():
            left_s = self._last_heard + self._silence_s - time.monotonic()
            if left_s <= 0.0:
                self._error = f"silent for {self._silence_s:g} s"
                break
            self._woken.wait(left_s)
        port_reader().remove(descriptor)

    def _fail(self, problem: str) -> None:
        self._error = problem
        self._woken.set()

    def _put(self, data: bytes) -> None:
        self._last_heard = time.monotonic()
        self._bytes_read += len(data)
        with self._queue_lock:
            if len(self._queue) >= _QUEUE_CHUNKS:
                self._bytes_dropped += len(self._queue.popleft().data)
            self._queue.append(Chunk(self._clock(), data))
        self._wake()

    def _close(self) -> None:
        with self._port_lock:
            port, self._port, self._name = self._port, None, ""
            if port is not None:
                port.close()
