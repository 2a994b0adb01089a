"""Cutting a damaged byte stream into lines of text."""

import re
from collections import Counter

LINE_END = rb"[\r\n\0]+"
"""CR, LF and NUL end a line in any mix, so CRLF, LF and the NULs of a port that was just opened all do."""


class LineSplitter:
    """Cuts bytes, in any chunking, into non-empty lines without their ends and outer blanks.

    `boundary` matches what separates two lines. Besides LINE_END it may hold zero-width alternatives such as
    `(?=DIST,)`, a place where a line starts although the end of the one before was lost; they may look at no more than
    CONTEXT bytes. A line longer than `max_length` bytes is dropped whole and counted in `losses` as `overlong_line`,
    which bounds the memory. Bytes that are no ASCII come out as U+FFFD, so no parser of text can mistake them.
    """

    CONTEXT = 16

    def __init__(self, boundary: bytes = LINE_END, max_length: int = 1024) -> None:
        self._boundary = re.compile(boundary)
        self._max_length = max_length
        self._tail = b""
        self._dropping = False
        self.losses: Counter[str] = Counter()

    def feed(self, data: bytes) -> list[str]:
        """Take the next bytes of the stream and return the lines they complete, in order."""
        *pieces, self._tail = self._boundary.split(self._tail + data)
        lines = []
        for piece in pieces:
            if not self._overlong(piece, self._max_length) and (line := piece.strip()):
                lines.append(line.decode("ascii", "replace"))
            self._dropping = False
        if self._overlong(self._tail, self._max_length + self.CONTEXT):  # its end may be the start of a boundary
            self._tail = self._tail[-self.CONTEXT :]
        return lines

    def reset(self) -> None:
        """Forget a partial line, after the link was reopened."""
        if self._tail:
            self.losses["partial_line"] += 1
        self._tail = b""
        self._dropping = False

    def _overlong(self, piece: bytes, limit: int) -> bool:
        if not self._dropping and len(piece) > limit:
            self.losses["overlong_line"] += 1
            self._dropping = True
        return self._dropping
