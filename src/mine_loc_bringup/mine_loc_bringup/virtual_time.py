"""Events of a replay in the order in which they are due, in two times: one that never jumps, and the bag's."""

import heapq
import itertools
from collections.abc import Callable
from typing import NamedTuple

from mine_loc_core.stamps import NS_PER_S

GAP_NS = 60 * NS_PER_S
"""A longer silence of a bag is a jump of its clock: nobody waits for it in a replay."""


class _Event(NamedTuple):
    due_ns: int
    number: int
    happen: Callable[[], None]


class VirtualTime:
    """The clock of a replay. `steady_ns` begins at 0; `ros_ns` is the bag's and may jump."""

    def __init__(self, ros_ns: int) -> None:
        self.steady_ns = 0
        self._offset_ns = ros_ns
        self._events: list[_Event] = []
        self._number = itertools.count()

    @property
    def ros_ns(self) -> int:
        """The bag's time."""
        return self.steady_ns + self._offset_ns

    def at(self, due_ns: int, happen: Callable[[], None]) -> None:
        """Let something happen at a steady time; what is due together happens in the order of these calls."""
        heapq.heappush(self._events, _Event(due_ns, next(self._number), happen))

    def advance(self, ros_ns: int) -> int:
        """Go on to a time of the bag, with everything that is due before. Returns the jump [ns] of the clock, mostly 0.

        Backwards, or over a gap, no time passes: the clock jumps.
        """
        ahead_ns = ros_ns - self.ros_ns
        if not 0 <= ahead_ns <= GAP_NS:
            self._offset_ns += ahead_ns
            return ahead_ns
        until_ns = self.steady_ns + ahead_ns
        while self._events and self._events[0].due_ns <= until_ns:
            event = heapq.heappop(self._events)
            self.steady_ns = max(self.steady_ns, event.due_ns)
            event.happen()
        self.steady_ns = until_ns
        return 0
