"""The stop signal of a machine, both ends: a heartbeat that permits running, a receiver that takes silence for stop."""

from collections.abc import Sequence
from dataclasses import dataclass

from mine_loc_core.stamps import to_ns, to_s

_COUNTS = 2**32
_MOST_LOST = 10
"""So many messages in a row may be lost; a greater gap is another sender."""
_LONGEST_REASON = 500
_LONGEST_VALID_S = 5.0
"""Nobody is permitted to run unheard for longer, whatever a message says."""


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
        self._state: tuple[str, int | None] = ("no stop signal heard yet", None)
        """Why it must stand, or the instant until which it may run. One object: another thread may read it any time."""

    def take(self, order: StopOrder, age_ns: int, steady_ns: int) -> None:
        """Take an order that was `age_ns` old (time of the stamps) when it arrived at `steady_ns`."""
        last, self._last = self._last, order
        if order.stop or not 0.0 < order.valid_for_s <= _LONGEST_VALID_S:
            self._state = order.reason or "told to stop", None
            return
        valid_ns = to_ns(order.valid_for_s)
        if last is None or not 1 <= (order.heartbeat - last.heartbeat) % _COUNTS <= _MOST_LOST:
            self._state = "heartbeat does not go on", None
        elif abs(age_ns) > valid_ns:
            self._state = f"stop signal came {to_s(age_ns):.1f} s old", None
        else:  # less than no age: clocks of two hosts differ a little
            self._state = "", steady_ns + valid_ns - max(age_ns, 0)

    def forget(self) -> None:
        """The time of the stamps was set: ages that were told before do not hold."""
        self._state = "clock was set", None

    def why_stop(self, steady_ns: int) -> str:
        """Why the machine must stand now; empty = it may run."""
        why, expires_ns = self._state
        return "stop signal is silent" if expires_ns is not None and steady_ns > expires_ns else why
