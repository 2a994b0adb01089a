"""Bag time as a function of steady time: at a rate, standing still while paused, set back at each loop."""


class Timeline:
    """All times are integer nanoseconds; `steady_ns` never goes back, bag time does only by `set`."""

    def __init__(self, bag_ns: int, steady_ns: int, rate: float) -> None:
        self._bag_ns = bag_ns
        self._steady_ns = steady_ns
        self._rate = rate
        self.paused = False

    def bag_ns(self, steady_ns: int) -> int:
        """Bag time at an instant."""
        if self.paused:
            return self._bag_ns
        return self._bag_ns + round((steady_ns - self._steady_ns) * self._rate)

    def wait_ns(self, bag_ns: int, steady_ns: int) -> int | None:
        """Steady time from an instant until a bag time; None while paused, 0 if it has passed."""
        if self.paused:
            return None
        return max(0, round((bag_ns - self.bag_ns(steady_ns)) / self._rate))

    def hold(self, bag_ns: int, most_behind_ns: int, steady_ns: int) -> None:
        """Set bag time back to where `bag_ns` is overdue by `most_behind_ns` of steady time, if by more it is."""
        latest_ns = bag_ns + round(most_behind_ns * self._rate)
        if self.bag_ns(steady_ns) > latest_ns:
            self.set(latest_ns, steady_ns)

    def set(self, bag_ns: int, steady_ns: int) -> None:
        """Go on from a bag time."""
        self._bag_ns, self._steady_ns = bag_ns, steady_ns

    def pause(self, steady_ns: int, *, paused: bool) -> None:
        """Stand still, or go on."""
        self.set(self.bag_ns(steady_ns), steady_ns)
        self.paused = paused

    def set_rate(self, rate: float, steady_ns: int) -> None:
        """Let bag time pass at another rate from now on."""
        self.set(self.bag_ns(steady_ns), steady_ns)
        self._rate = rate
