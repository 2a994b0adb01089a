"""What comes over a serial line: bytes with the instant of their arrival, and the line being pulled and plugged in."""

from enum import Enum


class Cable(Enum):
    """What happens to a line besides bytes."""

    UNPLUGGED = "unplugged"
    PLUGGED_IN = "plugged in"


Arrival = tuple[int, bytes | Cable]
"""Nanoseconds since the scene began, and what arrives then."""
