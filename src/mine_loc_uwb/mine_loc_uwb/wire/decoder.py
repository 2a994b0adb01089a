"""What all decoders share: the interface a driver sees, and the decoder of a format that consists of lines."""

from collections import Counter
from collections.abc import Callable
from typing import Protocol

from mine_loc_core.framing import Damaged
from mine_loc_core.line_splitter import LINE_END, LineSplitter
from mine_loc_uwb.ranging import Message


class Decoder(Protocol):
    """Turns the bytes of one serial line, in any chunking, into messages; never raises on what the bytes are."""

    @property
    def name(self) -> str:
        """Name of the wire format."""

    @property
    def tick_period_s(self) -> float:
        """Unit of `device_ticks` [s]; 0 = the format carries no device clock."""

    @property
    def counter_bits(self) -> int:
        """Width of the device clock, which wraps at 2**counter_bits; 0 without a clock."""

    @property
    def seq_bits(self) -> int:
        """Width of the round counter, which wraps at 2**seq_bits; 0 = the format has none."""

    @property
    def losses(self) -> Counter[str]:
        """What was lost, by the check that failed; counts since the decoder was made."""

    def feed(self, data: bytes) -> list[Message]:
        """Take the next bytes of the stream and return the messages they complete, in order."""

    def reset(self) -> None:
        """Forget a partial message, after the link was reopened."""


DecodeLine = Callable[[str], Message | Damaged | None]
"""Decodes one line: None = known and of no interest, Damaged = lost."""


class LineDecoder:
    """Decoder of a text format; `boundary` as in LineSplitter."""

    def __init__(
        self,
        name: str,
        decode_line: DecodeLine,
        *,
        boundary: bytes = LINE_END,
        tick_period_s: float = 0.0,
        counter_bits: int = 0,
        seq_bits: int = 0,
    ) -> None:
        self.name = name
        self.tick_period_s = tick_period_s
        self.counter_bits = counter_bits
        self.seq_bits = seq_bits
        self._decode_line = decode_line
        self._splitter = LineSplitter(boundary)
        self.losses = self._splitter.losses

    def feed(self, data: bytes) -> list[Message]:
        """Take the next bytes of the stream and return the messages they complete, in order."""
        messages = []
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
