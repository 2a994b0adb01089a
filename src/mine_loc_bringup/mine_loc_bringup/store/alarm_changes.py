"""Of alarms that are told again every second, what changed."""

from collections.abc import Iterable

from mine_loc_bringup.store.records import Alarm

CLEAR = 1
"""Of ProximityAlarm."""


class AlarmChanges:
    """Compares each situation with the one before. At the start nothing is known, so all alarms are news."""

    def __init__(self) -> None:
        self._now: dict[tuple[str, str], Alarm] = {}

    def take(self, stamp_ns: int, alarms: Iterable[Alarm]) -> list[Alarm]:
        """The alarms that are new or have another level or latch, and as CLEAR those that are gone."""
        before, self._now = self._now, {(alarm.person, alarm.zone): alarm for alarm in alarms}
        news = [
            alarm
            for key, alarm in self._now.items()
            if key not in before or (before[key].level, before[key].latched) != (alarm.level, alarm.latched)
        ]
        gone = [
            Alarm(stamp_ns, alarm.person, alarm.zone, CLEAR, False, None, None)
            for key, alarm in before.items()
            if key not in self._now and (alarm.level, alarm.latched) != (CLEAR, False)
        ]
        return news + gone
