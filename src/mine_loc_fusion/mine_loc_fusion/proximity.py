"""People in warning and danger zones (paper C): levels, events, and alarms that stay until acknowledged.

A zone has a body, fixed in the map or carried by a vehicle, and two distances round it. Each person and zone has a
presence in each of the two; danger goes before warning. What was a danger stays latched until it is acknowledged, and
cannot be while the person is still in it.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum

from mine_loc_fusion.inside_probability import inside_probability
from mine_loc_fusion.presence import Presence, PresenceRule
from mine_loc_fusion.zone_shape import Array, ZoneShape

MOST_ALARMS = 1024
"""Of ProximityAlarmArray."""


class AlarmLevel(IntEnum):
    """Constants of mine_loc_interfaces/ProximityAlarm."""

    CLEAR = 1
    WARNING = 2
    DANGER = 3


class AlarmEvent(IntEnum):
    """Constants of mine_loc_interfaces/ProximityAlarm."""

    ENTER = 1
    LEAVE = 2
    STAY = 3


@dataclass(frozen=True, slots=True)
class ProximityZone:
    """`body_m` (k, 2) in the map, or in the frame of `vehicle`; distances round it, None = no such zone."""

    id: str
    body_m: Array
    vehicle: str | None
    warning_m: float | None
    danger_m: float | None


@dataclass(frozen=True, slots=True)
class Pose2:
    """Where a vehicle stands in the map: metres, yaw in radians counter-clockwise from east."""

    x_m: float
    y_m: float
    yaw_rad: float


@dataclass(frozen=True, slots=True)
class Alarm:
    """One person and one zone. `probability` is that of being inside the zone of the level, `distance_m` the mean's
    distance from the body (0 inside it), `since_ns` the stamp at which the level was reached.
    """

    zone_id: str
    person: str
    level: AlarmLevel
    event: AlarmEvent
    probability: float
    distance_m: float
    since_ns: int
    latched: bool


@dataclass(slots=True)
class _Watched:
    """A person and a zone: presences by level, and the alarm of the moment."""

    presences: dict[AlarmLevel, Presence]
    alarm: Alarm | None = None


@dataclass(frozen=True, slots=True)
class ProximityRules:
    """When a person counts as inside a warning zone and a danger zone."""

    warning: PresenceRule
    danger: PresenceRule


@dataclass(slots=True)
class Proximity:
    """The alarms of all people and zones."""

    zones: tuple[ProximityZone, ...]
    rules: ProximityRules
    _watched: dict[tuple[str, str], _Watched] = field(default_factory=dict)

    def update(
        self, person: str, stamp_ns: int, mean_m: Array, covariance_m2: Array, vehicles: Mapping[str, Pose2]
    ) -> bool:
        """Take a person's position (2,) and its covariance (2, 2) in the map; whether a level changed.

        A zone whose vehicle is not in `vehicles` stays as it is.
        """
        changed = False
        for zone in self.zones:
            placed = placed_body(zone, vehicles)
            if placed is not None:
                changed |= self._judge(zone, placed, person, stamp_ns, mean_m, covariance_m2)
        return changed

    def alarms(self) -> tuple[Alarm, ...]:
        """Everybody inside a zone or latched, and whoever has just left; the worst first."""
        found = [watched.alarm for watched in self._watched.values() if watched.alarm is not None]
        return tuple(sorted(found, key=lambda alarm: (-alarm.level, not alarm.latched, -alarm.probability)))

    def published(self) -> None:
        """What was an event has been told: whoever is inside stays, who has left and is not latched vanishes."""
        for key, watched in list(self._watched.items()):
            alarm = watched.alarm
            if alarm is None:
                continue
            if alarm.level is not AlarmLevel.CLEAR:
                watched.alarm = replace(alarm, event=AlarmEvent.STAY)
            elif not alarm.latched:
                del self._watched[key]

    def endangered(self, vehicle: str) -> tuple[Alarm, ...]:
        """Alarms for which a vehicle must stand: danger in a zone that it carries, now or not yet acknowledged."""
        carried = {zone.id for zone in self.zones if zone.vehicle == vehicle}
        return tuple(alarm for alarm in self.alarms() if alarm.latched and alarm.zone_id in carried)

    def acknowledge(self, person: str = "") -> tuple[tuple[Alarm, ...], tuple[Alarm, ...]]:
        """Unlatch the alarms of a person, or all: those released, and those kept since the person is still there."""
        chosen = [
            watched
            for (who, _), watched in self._watched.items()
            if watched.alarm is not None and watched.alarm.latched and person in {"", who}
        ]
        kept = tuple(w.alarm for w in chosen if w.alarm and w.alarm.level is AlarmLevel.DANGER)
        released = []
        for watched in chosen:
            if watched.alarm and watched.alarm.level is not AlarmLevel.DANGER:
                watched.alarm = replace(watched.alarm, latched=False)
                released.append(watched.alarm)
        return tuple(released), kept

    def forget(self, people: Iterable[str]) -> None:
        """These people are gone: whatever was known of them counts no more, latched or not."""
        gone = set(people)
        for key in [key for key in self._watched if key[0] in gone]:
            del self._watched[key]

    def time_jumped(self) -> None:
        """Dwell times start anew; levels and latches stay."""
        for watched in self._watched.values():
            for presence in watched.presences.values():
                presence.time_jumped()

    def _judge(
        self, zone: ProximityZone, body: ZoneShape, person: str, stamp_ns: int, mean_m: Array, covariance_m2: Array
    ) -> bool:
        margins = {AlarmLevel.WARNING: zone.warning_m, AlarmLevel.DANGER: zone.danger_m}
        probabilities = {
            level: inside_probability(body.widened(margin_m), mean_m, covariance_m2)
            for level, margin_m in margins.items()
            if margin_m is not None
        }
        key = (person, zone.id)
        watched = self._watched.get(key)
        if watched is None:
            if not any(probabilities.values()):
                return False
            watched = self._watched[key] = _Watched({level: Presence(self._rule(level)) for level in probabilities})
        for level, probability in probabilities.items():
            watched.presences[level].update(stamp_ns, probability)
        inside = [level for level, presence in watched.presences.items() if presence.inside]
        level = max(inside, default=AlarmLevel.CLEAR)
        shown = probabilities.get(level, max(probabilities.values()))
        distance_m = max(float(body.signed_distance_m(mean_m[None])[0]), 0.0)
        now = Alarm(zone.id, person, level, AlarmEvent.STAY, shown, distance_m, stamp_ns, latched=False)
        return self._say(watched, now)

    def _say(self, watched: _Watched, now: Alarm) -> bool:
        """Put the new alarm in the last one's place; whether the level changed."""
        last, level = watched.alarm, now.level
        before = AlarmLevel.CLEAR if last is None else last.level
        latched = level is AlarmLevel.DANGER or (last is not None and last.latched)
        if level == before:
            if last is not None:
                watched.alarm = replace(now, event=last.event, since_ns=last.since_ns, latched=latched)
            return False
        event = AlarmEvent.ENTER if level > before else AlarmEvent.LEAVE
        watched.alarm = replace(now, event=event, latched=latched)
        return True

    def _rule(self, level: AlarmLevel) -> PresenceRule:
        return self.rules.danger if level is AlarmLevel.DANGER else self.rules.warning


def placed_body(zone: ProximityZone, vehicles: Mapping[str, Pose2]) -> ZoneShape | None:
    """The zone's body in the map; None where its vehicle's place is not known."""
    if zone.vehicle is None:
        return ZoneShape(zone.body_m)
    pose = vehicles.get(zone.vehicle)
    return None if pose is None else ZoneShape(zone.body_m).placed(pose.x_m, pose.y_m, pose.yaw_rad)
