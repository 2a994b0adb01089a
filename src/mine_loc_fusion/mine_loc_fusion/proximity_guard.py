"""Whether a vehicle may run: nobody in danger, and everybody's place known well enough to say so.

Not knowing is a reason to stop. Two clocks are used, both given by the caller: `now_ns`, the time of the stamps, says
how old a statement is; `steady_ns`, which nobody sets, says how long nothing was heard.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from mine_loc_core.stamps import to_ns, to_s
from mine_loc_fusion.possible_presence import DoubtRule, SeenPerson
from mine_loc_fusion.proximity import AlarmLevel, Pose2, Proximity, ProximityRules, ProximityZone, placed_body

MOST_PEOPLE = 4096


@dataclass(frozen=True, slots=True)
class GuardRules:
    """`silence_s`: longest silence of all poses; `alive_s`: of the fusion while nobody is positioned; `vehicle_s`:
    greatest age of a vehicle's pose.
    """

    alarms: ProximityRules
    doubt: DoubtRule
    silence_s: float
    alive_s: float
    vehicle_s: float


class ProximityGuard:
    """Alarms of the zones, and the reasons for which a vehicle must stand.

    `standing` are the poses of vehicles that do not move; all other vehicles must tell theirs (`take_vehicle`).
    """

    def __init__(self, zones: tuple[ProximityZone, ...], standing: Mapping[str, Pose2], rules: GuardRules) -> None:
        self.proximity = Proximity(zones, rules.alarms)
        self._rules = rules
        self._standing = dict(standing)
        self._moving: dict[str, tuple[int, Pose2]] = {}
        self._seen: dict[str, SeenPerson] = {}
        self._vouched: set[str] = set()
        self._crowded = False
        self._poses_ns: int | None = None
        self._alive_ns: int | None = None

    @property
    def vehicles(self) -> dict[str, Pose2]:
        """Where each vehicle was last known to be."""
        return self._standing | {vehicle: pose for vehicle, (_, pose) in self._moving.items()}

    def take_people(self, people: Iterable[SeenPerson], steady_ns: int) -> bool:
        """Take what the fusion says; whether an alarm changed.

        Positions that are not known (`DoubtRule`) move no alarm: they cannot end one, and are a reason of their own.
        """
        changed = False
        for seen in people:
            changed |= self._take(seen)
        self._poses_ns = steady_ns
        return changed

    def take_sign_of_life(self, steady_ns: int) -> None:
        """The fusion runs, whether or not it knows where anybody is."""
        self._alive_ns = steady_ns

    def take_vehicle(self, vehicle: str, stamp_ns: int, pose: Pose2) -> None:
        """Take where a vehicle says it is, map frame."""
        self._moving[vehicle] = (stamp_ns, pose)

    def stop_reasons(self, vehicle: str, now_ns: int, steady_ns: int) -> tuple[str, ...]:
        """Why the vehicle must stand; empty = it may run."""
        reasons = [*self._silence(steady_ns), *self._vehicle_unknown(vehicle, now_ns)]
        reasons += [
            f"{alarm.person} in danger zone {alarm.zone_id}"
            if alarm.level is AlarmLevel.DANGER
            else f"{alarm.person} was in danger zone {alarm.zone_id}: not acknowledged"
            for alarm in self.proximity.endangered(vehicle)
        ]
        return (*reasons, *self._possible(vehicle, now_ns))

    def vouch(self, person: str, now_ns: int) -> tuple[str, ...]:
        """Somebody says that a person (empty = all) is in no zone, of whom the fusion does not know where they are.

        Such people do not count, and what was latched of them is gone, until they are positioned again. Returns whom
        it concerns: who is well positioned counts as before.
        """
        doubt = self._rules.doubt
        chosen = tuple(name for name, seen in self._seen.items() if person in {"", name} and doubt.doubt(seen, now_ns))
        self._vouched |= set(chosen)
        self.proximity.forget(chosen)
        return chosen

    def forget_people(self, people: Iterable[str]) -> None:
        """These people are no longer of this site."""
        for name in people:
            self._seen.pop(name, None)
            self._vouched.discard(name)
        self.proximity.forget(people)

    def time_jumped(self, delta_ns: int) -> None:
        """The time of the stamps was set by `delta_ns`: what is known stays as old as it is."""
        self._seen = {name: replace(seen, stamp_ns=seen.stamp_ns + delta_ns) for name, seen in self._seen.items()}
        self._moving = {name: (stamp_ns + delta_ns, pose) for name, (stamp_ns, pose) in self._moving.items()}
        self.proximity.time_jumped()

    def _take(self, seen: SeenPerson) -> bool:
        if seen.person not in self._seen and len(self._seen) >= MOST_PEOPLE:
            self._crowded = True
            return False
        self._seen[seen.person] = seen
        if self._rules.doubt.doubt(seen, seen.stamp_ns):
            return False
        self._vouched.discard(seen.person)
        return self.proximity.update(seen.person, seen.stamp_ns, seen.mean_m, seen.covariance_m2, self.vehicles)

    def _silence(self, steady_ns: int) -> list[str]:
        if self._crowded:
            return [f"more than {MOST_PEOPLE} people"]
        rules = self._rules
        nobody = not self._seen
        heard_ns = [stamp for stamp in (self._poses_ns, self._alive_ns if nobody else None) if stamp is not None]
        allowed_s = rules.alive_s if nobody else rules.silence_s
        if not heard_ns:
            return ["no poses heard yet"]
        silent_ns = steady_ns - max(heard_ns)
        return [f"no poses for {to_s(silent_ns):.1f} s"] if silent_ns > to_ns(allowed_s) else []

    def _vehicle_unknown(self, vehicle: str, now_ns: int) -> list[str]:
        if vehicle in self._standing:
            return []
        if vehicle not in self._moving:
            return ["no pose of the vehicle heard yet"]
        age_ns = now_ns - self._moving[vehicle][0]
        if abs(age_ns) > to_ns(self._rules.vehicle_s):
            return [f"pose of the vehicle is {to_s(age_ns):.1f} s old"]
        return []

    def _possible(self, vehicle: str, now_ns: int) -> list[str]:
        """People who may be inside a danger zone that the vehicle carries."""
        rule, reasons = self._rules.doubt, []
        zones = [zone for zone in self.proximity.zones if zone.vehicle == vehicle and zone.danger_m is not None]
        bodies = [(zone, placed_body(zone, self.vehicles)) for zone in zones]
        for name, seen in self._seen.items():
            why = "" if name in self._vouched else rule.doubt(seen, now_ns)
            if not why:
                continue
            reasons += [
                f"{name} may be in danger zone {zone.id}: {why}"
                for zone, body in bodies
                if body is not None and rule.may_be_inside(seen, now_ns, body.widened(zone.danger_m or 0.0))
            ]
        return reasons
