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
    """A good frame: its content (None = good but of no interest) and its length on the wire in bytes."""

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
    memory held here.
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
        offset = 0
        while (offset := self._next_start(offset)) >= 0:
            result = self._parse(buffer, offset)
            if isinstance(result, Found):
                self.frames += 1
                offset += result.length
                if result.frame is not None:
                    frames.append(result.frame)
            elif isinstance(result, Damaged):
                self.losses[result.kind] += 1
                offset += 1
                self.losses["skipped_bytes"] += 1
            else:
                break
        del buffer[: offset if offset >= 0 else self._drop_tail()]
        return frames

    def reset(self) -> None:
        """Forget a partial frame, after the link was reopened."""
        self._count_skipped(len(self._buffer))
        self._buffer.clear()

    def _next_start(self, offset: int) -> int:
        found = self._buffer.find(self._start, offset)
        if found >= 0:
            self._count_skipped(found - offset)
        else:
            self._unsearched = offset
        return found

    def _drop_tail(self) -> int:
        """No start in sight: keep only what may be the beginning of one."""
        keep = next((n for n in range(len(self._start) - 1, 0, -1) if self._buffer.endswith(self._start[:n])), 0)
        end = max(len(self._buffer) - keep, self._unsearched)
        self._count_skipped(end - self._unsearched)
        return end

    def _count_skipped(self, count: int) -> None:
        if count:
            self.losses["skipped_bytes"] += count
