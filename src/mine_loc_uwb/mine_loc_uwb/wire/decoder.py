"""What all decoders share: the interface a driver sees, and the decoder of a format that consists of lines."""

from collections import Counter
from typing import Protocol

from mine_loc_core.line_decoder import DecodeLine, LineDecoder
from mine_loc_core.line_splitter import LINE_END
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


class TextDecoder(LineDecoder[Message]):
    """Decoder of a text format; `boundary` as in LineSplitter."""

    def __init__(
        self,
        name: str,
        decode_line: DecodeLine[Message],
        *,
        boundary: bytes = LINE_END,
        tick_period_s: float = 0.0,
        counter_bits: int = 0,
        seq_bits: int = 0,
    ) -> None:
        super().__init__(decode_line, boundary)
        self.name = name
        self.tick_period_s = tick_period_s
        self.counter_bits = counter_bits
        self.seq_bits = seq_bits
