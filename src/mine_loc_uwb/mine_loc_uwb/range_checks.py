"""What is refused of a measurement before any solver sees it, and why."""

import math

from mine_loc_core.stamps import NS_PER_MS
from mine_loc_core.verdicts import Reason

_FUTURE_NS = 50 * NS_PER_MS
_FROZEN_ROUNDS = 20
"""A radio's ranges scatter by 2 cm (hardware notes D.1); the same value this often is a stuck one."""


class RepeatedValues:
    """Remembers how often each link of a tag has said exactly the same."""

    def __init__(self) -> None:
        self._repeats: dict[int, tuple[float, int]] = {}

    def frozen(self, anchor_id: int, value_m: float) -> bool:
        """Take the next value of a link; whether it has repeated too often to be measured."""
        last_m, repeats = self._repeats.get(anchor_id, (math.nan, 0))
        repeats = repeats + 1 if value_m == last_m else 0
        self._repeats[anchor_id] = value_m, repeats
        return repeats >= _FROZEN_ROUNDS


def impossible(value_m: float, max_range_m: float, *, difference: bool) -> bool:
    """Whether no radio can have measured it: NaN, infinite, too long, or a range that is not positive."""
    if not math.isfinite(value_m) or abs(value_m) > max_range_m:
        return True
    return not difference and value_m <= 0.0


def stamp_reason(stamp_ns: int, last_ns: int | None, now_ns: int) -> Reason:
    """Solvers take instants that rise. One that has not come yet would lock out all that follow it."""
    if stamp_ns > now_ns + _FUTURE_NS:
        return Reason.FUTURE
    if last_ns is None or stamp_ns > last_ns:
        return Reason.ACCEPTED
    return Reason.DUPLICATE if stamp_ns == last_ns else Reason.BACKWARD
