"""People of whom nobody can say where they are: whether they may be inside a zone all the same."""

import math
from dataclasses import dataclass

import numpy as np

from mine_loc_core.stamps import to_ns, to_s
from mine_loc_fusion.estimate import ce95_m
from mine_loc_fusion.mode import Mode
from mine_loc_fusion.zone_shape import Array, ZoneShape

KNOWN_MODES = frozenset({Mode.UWB_PDR, Mode.UWB_ONLY, Mode.DEAD_RECKONING, Mode.COASTING})


@dataclass(frozen=True, slots=True)
class SeenPerson:
    """What the fusion last said of a person: position (2,) [m] and covariance (2, 2) [m²] in the map at `stamp_ns`."""

    person: str
    stamp_ns: int
    mean_m: Array
    covariance_m2: Array
    mode: Mode

    @property
    def stated(self) -> bool:
        """Whether position and covariance are numbers; a variance of 0 or below means that none was given."""
        numbers = np.isfinite(self.mean_m).all() and np.isfinite(self.covariance_m2).all()
        return bool(numbers and (np.diag(self.covariance_m2) > 0.0).all())

    @property
    def ce95_m(self) -> float:
        """Radius round the mean that holds the person with probability 0.95 at least; inf where nothing is known."""
        return ce95_m(self.covariance_m2) if self.stated else math.inf


@dataclass(frozen=True, slots=True)
class DoubtRule:
    """When a position is no evidence of absence.

    Older (or further in the future) than `timeout_s`; a 95 % circle wider than `vague_m`; a mode that claims no
    position. Such a person may have walked at `top_speed_m_s` since.
    """

    timeout_s: float
    vague_m: float
    top_speed_m_s: float

    def doubt(self, seen: SeenPerson, now_ns: int) -> str:
        """Why it is not known where the person is; empty if it is."""
        age_ns = now_ns - seen.stamp_ns
        if not seen.stated:
            return "no position with a covariance"
        if seen.mode not in KNOWN_MODES:
            return f"mode {seen.mode.name}"
        if abs(age_ns) > to_ns(self.timeout_s):
            return f"position is {to_s(age_ns):.1f} s old"
        if seen.ce95_m > self.vague_m:
            return f"95 % circle of {seen.ce95_m:.1f} m"
        return ""

    def may_be_inside(self, seen: SeenPerson, now_ns: int, shape: ZoneShape) -> bool:
        """Whether the 95 % circle, grown by what can have been walked since, reaches the zone."""
        if not seen.stated:
            return True
        reach_m = seen.ce95_m + self.top_speed_m_s * abs(to_s(now_ns - seen.stamp_ns))
        return bool(shape.signed_distance_m(seen.mean_m[None])[0] <= reach_m)
