"""Whether somebody counts as being inside: hysteresis in probability, and a least time for each change."""

from dataclasses import dataclass

from mine_loc_core.stamps import to_ns


@dataclass(frozen=True, slots=True)
class PresenceRule:
    """Inside once the probability was at least `enter` for `enter_dwell_s`; outside again once at most `leave` for
    `leave_dwell_s`. Between the two nothing changes.
    """

    enter: float
    leave: float
    enter_dwell_s: float
    leave_dwell_s: float


class Presence:
    """One person in one zone."""

    def __init__(self, rule: PresenceRule) -> None:
        self._rule = rule
        self._pending_ns: int | None = None
        self.inside = False
        self.since_ns = 0
        """Stamp of the last change."""

    def update(self, stamp_ns: int, probability: float) -> bool:
        """Take the probability [0..1] of being inside at an instant; whether that changed `inside`.

        A stamp before the one that a change is counted from (time was set back) begins to count anew.
        """
        rule = self._rule
        asks = probability <= rule.leave if self.inside else probability >= rule.enter
        if not asks:
            self._pending_ns = None
            return False
        if self._pending_ns is None or stamp_ns < self._pending_ns:
            self._pending_ns = stamp_ns
        dwell_s = rule.leave_dwell_s if self.inside else rule.enter_dwell_s
        if stamp_ns - self._pending_ns < to_ns(dwell_s):
            return False
        self.inside, self.since_ns, self._pending_ns = not self.inside, stamp_ns, None
        return True

    def time_jumped(self) -> None:
        """Stamps before and after do not belong together: what was counted is forgotten, `inside` stays."""
        self._pending_ns = None
