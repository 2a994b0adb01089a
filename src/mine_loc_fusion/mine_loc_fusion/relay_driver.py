"""Keeps an output as the stop signal wants it, in a thread of its own: writes for ever, reconnects, and lets go last.

It writes also what has not changed, since a device that has a watchdog wants to be spoken to.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

from mine_loc_fusion.relay_outputs import RelayError, RelayOutput

_FIRST_RETRY_S, _LAST_RETRY_S = 0.1, 1.0
_END_S = 0.8


@dataclass(frozen=True, slots=True)
class RelayStatus:
    """State of the output: `energised` None = not known, and why; why the machine is to stand; counters."""

    energised: bool | None = None
    error: str = "not written yet"
    why_stop: str = ""
    writes: int = 0
    failures: int = 0


class RelayDriver:
    """`why_stop` is asked before each write, from the thread: empty = the machine may run. What it raises is a stop."""

    def __init__(self, output: RelayOutput, why_stop: Callable[[], str], *, period_s: float) -> None:
        self._output, self._why_stop, self._period_s = output, why_stop, period_s
        self._retry_s = _FIRST_RETRY_S
        self._ending = threading.Event()
        self._due = threading.Event()
        self._thread = threading.Thread(target=self._run, name="relay", daemon=True)
        self.status = RelayStatus()

    def start(self) -> None:
        """Start writing."""
        self._thread.start()

    def write_now(self) -> None:
        """Do not wait for the next write."""
        self._due.set()

    def stop(self) -> None:
        """De-energise, close and end; returns within a second."""
        self._ending.set()
        self._due.set()
        if self._thread.is_alive():
            self._thread.join(timeout=_END_S)

    def _run(self) -> None:
        while not self._ending.is_set():
            wait_s = self._cycle()
            self._due.wait(wait_s)
            self._due.clear()
        self._set("the node ends")
        self._output.close()

    def _cycle(self) -> float:
        """Write once; how long to wait for the next time [s]."""
        try:
            why = self._why_stop()
        except Exception as error:  # noqa: BLE001 whatever it is, the machine must not run on it
            why = f"the stop signal cannot be judged: {error!r}"
        if self._set(why):
            self._retry_s = _FIRST_RETRY_S
            return self._period_s
        self._output.close()
        wait_s, self._retry_s = self._retry_s, min(2.0 * self._retry_s, _LAST_RETRY_S)
        return wait_s

    def _set(self, why: str) -> bool:
        before = self.status
        try:
            self._output.write(energised=not why)
        except RelayError as error:
            self.status = replace(before, energised=None, error=str(error), why_stop=why, failures=before.failures + 1)
            return False
        self.status = replace(before, energised=not why, error="", why_stop=why, writes=before.writes + 1)
        return True
