"""What the store keeps, as plain rows. Stamps are ROS time in ns; lengths in m, variances in m², in the map (ENU).

A number that is not known, or not finite in the message, is None. Only JSON's types occur, so that a row can wait in a
file for its database.
"""

import math
from typing import NamedTuple

from mine_loc_fusion.mode import Mode

NOWHERE = frozenset(map(int, (Mode.UNKNOWN, Mode.INITIALISING, Mode.LOST)))
"""Modes that do not say where the person is."""


class Pose(NamedTuple):
    """A fused pose. `areas`: ids of the zones, galleries and chambers it lies in, filled in by the store."""

    person: str
    stamp_ns: int
    x_m: float | None
    y_m: float | None
    z_m: float | None
    yaw_rad: float | None
    variance_x_m2: float | None
    covariance_xy_m2: float | None
    variance_y_m2: float | None
    velocity_x_m_s: float | None
    velocity_y_m_s: float | None
    ce95_m: float | None
    mode: int
    since_uwb_s: float | None
    areas: tuple[str, ...] = ()

    @property
    def placed(self) -> bool:
        """Whether it says where the person is."""
        return self.mode not in NOWHERE and self.x_m is not None and self.y_m is not None


class ZoneEvent(NamedTuple):
    """A person entered or left an area, or was lost sight of in it (`event`: enter, leave, lost)."""

    stamp_ns: int
    person: str
    area: str
    event: str
    dwell_s: float | None


class Region(NamedTuple):
    """A coarse region; `status` as in CoarseRegion, `person` empty where nobody is known to carry the emitter."""

    stamp_ns: int
    region_id: int
    person: str
    x_m: float | None
    y_m: float | None
    radius_m: float | None
    probability: float | None
    confidence: float | None
    status: int
    last_heard_ns: int
    galleries: str


class Alarm(NamedTuple):
    """A change of a proximity alarm; `level` as in ProximityAlarm, CLEAR when it is gone."""

    stamp_ns: int
    person: str
    zone: str
    level: int
    latched: bool
    probability: float | None
    distance_m: float | None


class RangeRound(NamedTuple):
    """Summary of a ranging round; `los_fraction`: mean LOS probability of the ranges judged, None = none was."""

    stamp_ns: int
    tag_id: int
    reporter_id: int
    ranges: int
    los_fraction: float | None
    shortest_m: float | None
    longest_m: float | None


Record = Pose | ZoneEvent | Region | Alarm | RangeRound
KINDS: dict[str, type[Record]] = {
    "poses": Pose,
    "zone_events": ZoneEvent,
    "regions": Region,
    "alarms": Alarm,
    "range_rounds": RangeRound,
}
TABLE_OF: dict[type[Record], str] = {kind: table for table, kind in KINDS.items()}


def finite(value: float) -> float | None:
    """The number, None where it is none."""
    return value if math.isfinite(value) else None
