"""The search for the number of people that the graph holds."""

from collections.abc import Callable, Mapping
from typing import Any

from mine_loc_sim.scene import MOST_PEOPLE

LONGEST_P99_MS = 100.0
_NARROW_SHARE = 0.25
"""The search ends when the fleet is known to so much of itself."""

Figures = Mapping[str, Any]


def held(figures: Figures) -> bool:
    """Whether 99 of 100 rounds are answered in time; a round without an answer took for ever."""
    return bool(figures["latency_p99_ms"] <= LONGEST_P99_MS)


def largest_fleet(play: Callable[[int], Figures], first: int) -> tuple[int, dict[int, Figures]]:
    """Double from `first` until a fleet is not held, then halve the interval; the largest held, and all that was tried.

    No scene has more than MOST_PEOPLE. A fleet is given a second chance before it counts as not held, since a stall of
    the machine is no property of the graph.
    """
    tried: dict[int, Figures] = {}

    def holds(people: int) -> bool:
        for _ in range(2):
            tried[people] = play(people)
            if held(tried[people]):
                return True
        return False

    good, people = 0, first
    while holds(people):
        good = people
        if people == MOST_PEOPLE:
            return good, tried
        people = min(2 * people, MOST_PEOPLE)
    bad = people
    while bad - good > max(1, round(_NARROW_SHARE * good)):
        middle = (good + bad) // 2
        good, bad = (middle, bad) if holds(middle) else (good, middle)
    return good, tried
