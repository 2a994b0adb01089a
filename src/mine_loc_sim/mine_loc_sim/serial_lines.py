"""Serial lines that are not there: pseudo-terminals or TCP ports into which arrivals are played at their own pace."""

import contextlib
import os
import queue
import select
import socket
import threading
import time
import tty
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol

from mine_loc_core.stamps import NS_PER_S
from mine_loc_sim.timed_bytes import Arrival, Cable

_BLOCKS_AHEAD = 2
_FULL_S = 0.1


class Line(Protocol):
    """One end of a serial line."""

    @property
    def address(self) -> str:
        """What a driver opens: a path, or `socket://host:port`."""

    def plug_in(self) -> None:
        """Make the line available."""

    def unplug(self) -> None:
        """Take the line away."""

    def write(self, data: bytes) -> None:
        """Send bytes; what nobody reads is lost, as on a real line."""


class PseudoSerial:
    """One serial line under a stable name: `port` is a link to the pseudo-terminal, laid anew by `plug_in`."""

    def __init__(self, port: Path) -> None:
        self.port = port
        self._master = self._slave = -1
        self._read = True
        self.plug_in()

    @property
    def address(self) -> str:
        """Path of the link."""
        return str(self.port)

    def plug_in(self) -> None:
        """Open a pseudo-terminal and lay the link to it."""
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.port.parent.mkdir(parents=True, exist_ok=True)
        self.port.unlink(missing_ok=True)
        self.port.symlink_to(os.ttyname(self._slave))

    def unplug(self) -> None:
        """Close the pseudo-terminal and take the link away, as a pulled cable does."""
        self.port.unlink(missing_ok=True)
        ends, self._master, self._slave = (self._slave, self._master), -1, -1  # a player may be writing
        for end in ends:
            os.close(end)

    def write(self, data: bytes) -> None:
        """Send bytes, more than the terminal holds (some kilobytes) as they are read.

        What nobody reads is lost, as on a real line: a line that was full for a while is not waited for again until it
        takes a whole message.
        """
        left = memoryview(data)
        with contextlib.suppress(OSError):
            while left:
                try:
                    left = left[os.write(self._master, left) :]
                except BlockingIOError:
                    if not (self._read and select.select([], [self._master], [], _FULL_S)[1]):
                        break
            self._read = not left

    def read(self) -> bytes:
        """What the other side wrote, nothing if nothing."""
        with contextlib.suppress(BlockingIOError, OSError):
            return os.read(self._master, 4096)
        return b""


class TcpBridge:
    """One serial line behind a bridge in raw TCP on this host, with a client at a time; a later one takes over."""

    def __init__(self) -> None:
        self._server: socket.socket | None = None
        self._client: socket.socket | None = None
        self._port = 0
        self.plug_in()

    @property
    def address(self) -> str:
        """URL of the port."""
        return f"socket://127.0.0.1:{self._port}"

    def plug_in(self) -> None:
        """Listen, on the same port as before."""
        self._server = socket.create_server(("127.0.0.1", self._port))
        self._server.setblocking(False)
        self._port = self._server.getsockname()[1]

    def unplug(self) -> None:
        """Close the port and the connection."""
        for each in (self._client, self._server):
            if each is not None:
                each.close()
        self._client = self._server = None

    def write(self, data: bytes) -> None:
        """Send bytes to whoever is connected."""
        with contextlib.suppress(BlockingIOError):
            if self._server is not None:
                newcomer, _ = self._server.accept()
                newcomer.setblocking(False)
                newcomer.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self._client = newcomer
        with contextlib.suppress(BlockingIOError, OSError):
            if self._client is not None:
                self._client.send(data)


class Player:
    """Plays arrivals into a line from a common start, in a thread of its own."""

    def __init__(self, line: Line, arrivals: Iterable[Arrival], speed: float = 1.0) -> None:
        self._line = line
        self._arrivals = arrivals
        self._speed = speed
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self.played = 0

    def start(self, start_monotonic_s: float) -> None:
        """Begin; time 0 of the arrivals is `start_monotonic_s` of time.monotonic()."""
        self._thread = threading.Thread(target=self._run, args=(start_monotonic_s,), daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Fall silent."""
        self._stop.set()

    @property
    def done(self) -> bool:
        """Whether all has been played."""
        return self._thread is not None and not self._thread.is_alive()

    def _run(self, start_s: float) -> None:
        for at_ns, what in self._arrivals:
            due_s = start_s + at_ns / NS_PER_S / self._speed
            if self._stop.wait(max(0.0, due_s - time.monotonic())):
                return
            if what is Cable.UNPLUGGED:
                self._line.unplug()
            elif what is Cable.PLUGGED_IN:
                self._line.plug_in()
            elif isinstance(what, bytes):
                self._line.write(what)
                self.played += 1


class Ahead:
    """Makes blocks of arrivals in a thread, a few ahead of those who play them; `problem` says why it ended early.

    Every line must be played: the slowest one holds the others up.
    """

    def __init__(self, blocks: Iterable[Mapping[str, Sequence[Arrival]]], lines: Iterable[str]) -> None:
        self._blocks = blocks
        self._queues: dict[str, queue.Queue[Sequence[Arrival] | None]] = {
            line: queue.Queue(_BLOCKS_AHEAD) for line in lines
        }
        self._ready = threading.Event()
        self.problem: Exception | None = None
        threading.Thread(target=self._run, daemon=True).start()

    def wait_ready(self, timeout_s: float) -> bool:
        """Wait for the first block; False if it took longer."""
        return self._ready.wait(timeout_s)

    def arrivals(self, line: str) -> Iterator[Arrival]:
        """Yield what arrives over a line."""
        while (block := self._queues[line].get()) is not None:
            yield from block

    def _run(self) -> None:
        try:
            for block in self._blocks:
                for line, line_queue in self._queues.items():
                    line_queue.put(block[line])
                self._ready.set()
        except Exception as error:  # noqa: BLE001 handed on to whoever asks why the lines fell silent
            self.problem = error
        finally:
            self._ready.set()
            for line_queue in self._queues.values():
                line_queue.put(None)
