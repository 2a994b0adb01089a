"""Serial lines that are not there: pseudo-terminals into which a recording is played at its own pace."""

import contextlib
import os
import threading
import time
import tty
from collections.abc import Sequence
from pathlib import Path

from mine_loc_bringup.demo.recording import Burst


class PseudoSerial:
    """One serial line under a stable name: `port` is a link to the pseudo-terminal, laid anew by `plug_in`."""

    def __init__(self, port: Path) -> None:
        self.port = port
        self._master = self._slave = -1
        self.plug_in()

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
        ends, self._master, self._slave = (self._slave, self._master), -1, -1
        for end in ends:
            os.close(end)

    def write(self, data: bytes) -> None:
        """Send bytes; what nobody reads is lost, as on a real line."""
        with contextlib.suppress(BlockingIOError, OSError):
            os.write(self._master, data)

    def read(self) -> bytes:
        """What the other side wrote, nothing if nothing."""
        with contextlib.suppress(BlockingIOError, OSError):
            return os.read(self._master, 4096)
        return b""


class Player:
    """Plays bursts into a line from a common start, in a thread of its own."""

    def __init__(self, line: PseudoSerial, bursts: Sequence[Burst]) -> None:
        self._line = line
        self._bursts = bursts
        self._stop = threading.Event()
        self.played = 0

    def start(self, start_monotonic_s: float) -> None:
        """Begin; time 0 of the recording is `start_monotonic_s` of time.monotonic()."""
        threading.Thread(target=self._run, args=(start_monotonic_s,), daemon=True).start()

    def stop(self) -> None:
        """Fall silent."""
        self._stop.set()

    def _run(self, start_s: float) -> None:
        for at_s, data in self._bursts:
            if self._stop.wait(max(0.0, start_s + at_s - time.monotonic())):
                return
            self._line.write(data)
            self.played += 1
