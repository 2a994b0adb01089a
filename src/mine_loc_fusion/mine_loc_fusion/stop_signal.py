"""The stop signal of a machine, both ends: a heartbeat that permits running, a receiver that takes silence for stop."""

from collections.abc import Sequence
from dataclasses import dataclass

from mine_loc_core.stamps import to_ns, to_s

_COUNTS = 2**32
_MOST_LOST = 10
"""So many messages in a row may be lost; a greater gap is another sender."""
_LONGEST_REASON = 500


@dataclass(frozen=True, slots=True)
class StopOrder:
    """One message: stop, or permission to run for `valid_for_s` from its stamp on."""

    stop: bool
    heartbeat: int
    valid_for_s: float
    reason: str


class StopSender:
    """Numbers the orders to one vehicle."""

    def __init__(self, valid_for_s: float) -> None:
        self._valid_for_s = valid_for_s
        self._heartbeat = 0

    def order(self, reasons: Sequence[str]) -> StopOrder:
        """The next order: stop if there is any reason."""
        self._heartbeat = (self._heartbeat + 1) % _COUNTS
        return StopOrder(bool(reasons), self._heartbeat, self._valid_for_s, "; ".join(reasons)[:_LONGEST_REASON])


class StopReceiver:
    """What a machine may believe: running needs a permission that is fresh, of a heart that beats, and none against it.

    A permission counts when the heartbeat went on since the last message (a repeated or older one is a sender that
    hangs, began anew, or is a second one: the next message decides), and until it is `valid_for_s` old. How old it was
    on arrival comes from its stamp; from there on a steady clock counts, which a pause of simulated time does not stop.
    """

    def __init__(self) -> None:
        self._last: StopOrder | None = None
        self._expires_ns: int | None = None
        self._why = "no stop signal heard yet"

    def take(self, order: StopOrder, age_ns: int, steady_ns: int) -> None:
        """Take an order that was `age_ns` old (time of the stamps) when it arrived at `steady_ns`."""
        last, self._last = self._last, order
        self._expires_ns = None
        valid_ns = to_ns(order.valid_for_s)
        if order.stop:
            self._why = order.reason or "told to stop"
        elif last is None or not 1 <= (order.heartbeat - last.heartbeat) % _COUNTS <= _MOST_LOST:
            self._why = "heartbeat does not go on"
        elif abs(age_ns) > valid_ns:
            self._why = f"stop signal came {to_s(age_ns):.1f} s old"
        else:
            self._expires_ns = steady_ns + valid_ns - max(age_ns, 0)  # clocks of two hosts differ a little
            self._why = ""

    def why_stop(self, steady_ns: int) -> str:
        """Why the machine must stand now; empty = it may run."""
        if self._expires_ns is None:
            return self._why
        return "stop signal is silent" if steady_ns > self._expires_ns else ""
