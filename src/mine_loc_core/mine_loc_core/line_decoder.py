"""Decoding a damaged byte stream that consists of lines of text."""

from collections.abc import Callable
from typing import Generic, TypeVar

from mine_loc_core.framing import Damaged
from mine_loc_core.line_splitter import LINE_END, LineSplitter

T = TypeVar("T")
DecodeLine = Callable[[str], T | Damaged | None]
"""Decodes one line: None = known and of no interest, Damaged = lost."""


class LineDecoder(Generic[T]):
    """Decodes lines of bytes in any chunking; `boundary` as in LineSplitter, `losses` by the check that failed."""

    def __init__(self, decode_line: DecodeLine[T], boundary: bytes = LINE_END) -> None:
        self._decode_line = decode_line
        self._splitter = LineSplitter(boundary)
        self.losses = self._splitter.losses

    def feed(self, data: bytes) -> list[T]:
        """Take the next bytes of the stream and return the messages they complete, in order."""
        messages: list[T] = []
        for line in self._splitter.feed(data):
            result = self._decode_line(line)
            if isinstance(result, Damaged):
                self.losses[result.kind] += 1
            elif result is not None:
                messages.append(result)
        return messages

    def reset(self) -> None:
        """Forget a partial line, after the link was reopened."""
        self._splitter.reset()
