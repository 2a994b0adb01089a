"""Which zones, galleries and chambers people are in: entered at the border, left only beyond a margin."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mine_loc_bringup.store.records import Pose, Record, ZoneEvent
from mine_loc_core.site import Chamber, Site
from mine_loc_core.stamps import to_ns, to_s
from mine_loc_core.walkable_area import WalkableArea

_SILENCE_NS = to_ns(10.0)
"""Whoever was not heard of for so long has left without being seen."""


@dataclass(slots=True)
class _Stay:
    inside: int
    """One bit an area."""
    last_ns: int
    entered_ns: dict[int, int]


class AreaWatch:
    """Everybody's areas, from the mean of their poses. Zones that a vehicle carries are left out: see the alarms."""

    def __init__(self, site: Site, margin_m: float) -> None:
        zones = [zone for zone in site.zones if zone.vehicle is None and zone.polygon_m]
        hollows = [Chamber(zone.id, zone.polygon_m, 0.0, 0.0) for zone in zones] + list(site.chambers)
        shapes = {hollow.id: WalkableArea((), (hollow,)) for hollow in hollows}
        shapes |= {gallery.id: WalkableArea((gallery,)) for gallery in site.galleries}
        self.names = tuple(sorted(shapes))
        self._shapes = [shapes[name] for name in self.names]
        self._margin_m = margin_m
        self._stays: dict[str, _Stay] = {}
        self._named: dict[int, tuple[str, ...]] = {}

    def arrange(self, records: Sequence[Record]) -> list[Record]:
        """The records, poses with their areas and followed by what they made happen."""
        poses = [record for record in records if isinstance(record, Pose) and record.placed]
        bits = iter(self._bits(poses))
        arranged: list[Record] = []
        for record in records:
            if not isinstance(record, Pose):
                arranged.append(record)
                continue
            inside, near = next(bits) if record.placed else (0, 0)
            areas, events = self._follow(record, inside, near)
            arranged += [record._replace(areas=areas), *events]
        return arranged

    def _bits(self, poses: Sequence[Pose]) -> list[tuple[int, int]]:
        """For each pose the areas it is inside of, and those within the margin, as bits."""
        points_m = np.array([(pose.x_m, pose.y_m) for pose in poses], dtype=float).reshape(-1, 2)
        outside_m = (
            np.array([shape.outside_m(points_m) for shape in self._shapes]).reshape(len(self._shapes), len(poses)).T
        )
        inside, near = (np.packbits(outside_m <= limit, axis=1, bitorder="little") for limit in (0.0, self._margin_m))
        return [
            (int.from_bytes(a.tobytes(), "little"), int.from_bytes(b.tobytes(), "little"))
            for a, b in zip(inside, near, strict=True)
        ]

    def _follow(self, pose: Pose, inside: int, near: int) -> tuple[tuple[str, ...], list[Record]]:
        events: list[Record] = []
        stay = self._stays.get(pose.person)
        if stay and not 0 <= pose.stamp_ns - stay.last_ns <= _SILENCE_NS:
            events += self._changes(pose.person, stay, 0, stay.last_ns, "lost")
        if stay is None:
            stay = self._stays[pose.person] = _Stay(0, pose.stamp_ns, {})
        now = inside | (stay.inside & near)
        events += self._changes(pose.person, stay, now, pose.stamp_ns, "leave" if pose.placed else "lost")
        stay.last_ns = pose.stamp_ns
        return self._names_of(now), events

    def _changes(self, person: str, stay: _Stay, now: int, stamp_ns: int, gone: str) -> list[Record]:
        changed, stay.inside = stay.inside ^ now, now
        events: list[Record] = []
        while changed:
            bit = changed & -changed
            changed ^= bit
            (area,) = self._names_of(bit)
            if now & bit:
                stay.entered_ns[bit] = stamp_ns
                events.append(ZoneEvent(stamp_ns, person, area, "enter", None))
            else:
                dwell_s = to_s(stamp_ns - stay.entered_ns.pop(bit))
                events.append(ZoneEvent(stamp_ns, person, area, gone, dwell_s))
        return events

    def _names_of(self, bits: int) -> tuple[str, ...]:
        if bits not in self._named:
            self._named[bits] = tuple(name for number, name in enumerate(self.names) if bits >> number & 1)
        return self._named[bits]
