"""Choosing the decoder of a serial line: by name, or by watching which format its bytes make sense in."""

from collections import Counter, deque
from collections.abc import Callable

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.ranging import Message
from mine_loc_uwb.wire import arduino, dwm1001_shell, trek1000
from mine_loc_uwb.wire.decoder import Decoder
from mine_loc_uwb.wire.dwm1001_tlv import TlvDecoder
from mine_loc_uwb.wire.mine_loc_frame import MineLocDecoder
from mine_loc_uwb.wire.nlink import NlinkDecoder

_MAKERS: dict[str, Callable[[], Decoder]] = {
    "trek1000": trek1000.decoder,
    "dwm1001_shell": dwm1001_shell.decoder,
    "dwm1001_tlv": TlvDecoder,
    "arduino": arduino.decoder,
    "nlink": NlinkDecoder,
    "mine_loc": MineLocDecoder,
}

FORMATS = tuple(_MAKERS)
"""Names of all wire formats."""


def make_decoder(name: str) -> Decoder:
    """Return a fresh decoder. Raises ConfigurationError for a name that is not in FORMATS."""
    try:
        return _MAKERS[name]()
    except KeyError:
        raise ConfigurationError(f"wire format '{name}' is unknown; allowed: {', '.join(FORMATS)}") from None


class AutoDetect:
    """A decoder that finds out by itself which format it hears.

    It feeds every decoder until one leads all others by LEAD messages, then delivers what that one has decoded so far
    and from then on asks no other. `reset` opens the question again: another device may have been plugged in.
    """

    LEAD = 3
    MAX_HELD = 256
    """Messages kept for each format while undecided; older ones are dropped and counted as `undecided_overflow`."""

    def __init__(self) -> None:
        self._past_losses: Counter[str] = Counter()
        self._begin()

    def _begin(self) -> None:
        self._candidates = [make_decoder(name) for name in FORMATS]
        self._held: dict[str, deque[Message]] = {name: deque(maxlen=self.MAX_HELD) for name in FORMATS}
        self._counts: Counter[str] = Counter(dict.fromkeys(FORMATS, 0))
        self._winner: Decoder | None = None

    @property
    def name(self) -> str:
        """Name of the format found, `undecided` until then."""
        return self._winner.name if self._winner else "undecided"

    @property
    def tick_period_s(self) -> float:
        """Unit of `device_ticks` of the format found [s], 0 until then."""
        return self._winner.tick_period_s if self._winner else 0.0

    @property
    def counter_bits(self) -> int:
        """Width of the device clock of the format found, 0 until then."""
        return self._winner.counter_bits if self._winner else 0

    @property
    def seq_bits(self) -> int:
        """Width of the round counter of the format found, 0 until then."""
        return self._winner.seq_bits if self._winner else 0

    @property
    def losses(self) -> Counter[str]:
        """Losses of the format found; while undecided nothing can be told from another format's good bytes."""
        return self._past_losses + (self._winner.losses if self._winner else Counter())

    def feed(self, data: bytes) -> list[Message]:
        """Take the next bytes of the stream and return the messages they complete, none while undecided."""
        if self._winner:
            return self._winner.feed(data)
        for candidate in self._candidates:
            messages = candidate.feed(data)
            self._held[candidate.name].extend(messages)
            self._counts[candidate.name] += len(messages)
        (leader, count), (_, second_count) = self._counts.most_common(2)
        if count - second_count < self.LEAD:
            return []
        self._winner = self._candidates[FORMATS.index(leader)]
        overflow = count - len(self._held[leader])
        if overflow:
            self._past_losses["undecided_overflow"] += overflow
        messages = list(self._held[leader])
        self._held.clear()
        self._candidates.clear()
        return messages

    def reset(self) -> None:
        """Forget the format found, after the link was reopened."""
        self._past_losses = self.losses
        self._begin()
