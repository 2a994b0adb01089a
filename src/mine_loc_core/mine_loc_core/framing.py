"""Finding binary frames in a byte stream that may be damaged anywhere.

A scanner takes bytes in any chunking. After damage it rescans from the byte after the bad start, so a good frame
that begins inside a broken one is never lost, and it counts every loss by kind. It never raises on hostile input.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Found(Generic[T]):
    """A good frame: its content (None = good but of no interest) and its length on the wire in bytes (at least 1)."""

    frame: T | None
    length: int


@dataclass(frozen=True, slots=True)
class Incomplete:
    """The bytes so far are the beginning of a frame."""


@dataclass(frozen=True, slots=True)
class Damaged:
    """No frame starts here; `kind` names the check that failed and is what the loss is counted under."""

    kind: str


INCOMPLETE = Incomplete()
Parse = Callable[[bytearray, int], Found[T] | Incomplete | Damaged]


class FrameScanner(Generic[T]):
    """Cuts a byte stream into frames.

    `start` is the byte sequence every frame begins with; `parse(buffer, offset)` judges the bytes from `offset`, where
    `start` stands. A parser must answer Damaged rather than Incomplete for a length beyond its cap, which bounds the
    memory held here. `losses` counts failed checks by their kind and, as `skipped_bytes`, every byte outside a frame.
    """

    def __init__(self, start: bytes, parse: Parse[T]) -> None:
        self._start = start
        self._parse = parse
        self._buffer = bytearray()
        self.losses: Counter[str] = Counter()
        self.frames = 0

    def feed(self, data: bytes) -> list[T]:
        """Take the next bytes of the stream and return the frames they complete, in order."""
        buffer = self._buffer
        buffer += data
        frames: list[T] = []
        offset = self._skip_to_start(0)
        while buffer.startswith(self._start, offset):
            result = self._parse(buffer, offset)
            if isinstance(result, Incomplete):
                break
            if isinstance(result, Found):
                self.frames += 1
                offset += result.length
                if result.frame is not None:
                    frames.append(result.frame)
            else:
                self.losses[result.kind] += 1
                self._count_skipped(1)
                offset += 1
            offset = self._skip_to_start(offset)
        del buffer[:offset]
        return frames

    def reset(self) -> None:
        """Forget a partial frame, after the link was reopened."""
        self._count_skipped(len(self._buffer))
        self._buffer.clear()

    def _skip_to_start(self, offset: int) -> int:
        """Where the next frame, or at the end of the buffer the beginning of its start sequence, stands."""
        buffer, start = self._buffer, self._start
        found = buffer.find(start, offset)
        if found < 0:
            tail = min(len(start) - 1, len(buffer) - offset)
            partial = next((n for n in range(tail, 0, -1) if buffer.endswith(start[:n])), 0)
            found = len(buffer) - partial
        self._count_skipped(found - offset)
        return found

    def _count_skipped(self, count: int) -> None:
        if count:
            self.losses["skipped_bytes"] += count
