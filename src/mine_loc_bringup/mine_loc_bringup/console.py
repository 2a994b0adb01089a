"""What `mine-loc up` writes: the nodes' output, each line with its node's name before it, and what becomes of them."""

import contextlib
import itertools
import sys
from typing import TextIO

from mine_loc_bringup.supervisor import Event, EventKind

_COLOURS = (36, 32, 33, 35, 34, 96, 92, 93, 95, 94)  # SGR foreground: all but red, which says trouble
_RED = 31


class Console:
    """Writes to a terminal in colours, to anything else in plain text. A closed output never stops the graph."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self._stream = stream or sys.stdout
        self._coloured = self._stream.isatty()
        self._colours = itertools.cycle(_COLOURS)
        self._colour_of: dict[str, int] = {}

    def line(self, name: str, text: str) -> None:
        """A line of output of a node."""
        if name not in self._colour_of:
            self._colour_of[name] = next(self._colours)
        self._write(f"{self._paint(f'[{name}]', self._colour_of[name])} {text}")

    def event(self, event: Event) -> None:
        """Something became of a node."""
        text = f"[{event.name}] {event.kind.value}"
        if event.detail:
            text += f": {event.detail}"
        if event.status is not None:
            text += f", {_status(event.status)}"
        if event.delay_s is not None:
            text += f"; starting it again in {event.delay_s:.1f} s"
        trouble = event.kind in {EventKind.DIED, EventKind.FAILED, EventKind.KILLED}
        self._write(self._paint(text, _RED) if trouble else text)

    def trouble(self, text: str) -> None:
        """A message of the supervisor itself."""
        self._write(self._paint(text, _RED))

    def _paint(self, text: str, colour: int) -> str:
        return f"\x1b[{colour}m{text}\x1b[0m" if self._coloured else text

    def _write(self, text: str) -> None:
        with contextlib.suppress(OSError, ValueError):
            print(text, file=self._stream, flush=True)


def _status(status: int) -> str:
    return f"signal {-status}" if status < 0 else f"exit status {status}"
