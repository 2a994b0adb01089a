"""Time as integer nanoseconds. Seconds as float appear only at the borders, where a message or a person reads them."""

from typing import Protocol

NS_PER_S = 1_000_000_000
NS_PER_MS = 1_000_000
NS_PER_US = 1_000


class Stamp(Protocol):
    """builtin_interfaces/Time, of whatever library."""

    sec: int
    nanosec: int


def to_stamp_ns(stamp: Stamp) -> int:
    """builtin_interfaces/Time to nanoseconds since the epoch."""
    return stamp.sec * NS_PER_S + stamp.nanosec


def to_ns(seconds: float) -> int:
    """Seconds to nanoseconds, rounded; meant for durations and parameters, not for stamps since 1970."""
    return round(seconds * NS_PER_S)


def to_s(nanoseconds: int) -> float:
    """Nanoseconds to seconds; exact to the nanosecond for durations below 48 days."""
    return nanoseconds / NS_PER_S
