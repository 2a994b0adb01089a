"""What grows old is thinned and at last deleted, an hour of rows at a time, so that no writer waits for long."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from sqlalchemy import ColumnElement, Connection, Table, delete, func, select, tuple_, update

from mine_loc_bringup.store import tables
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_S

_DAY_NS = 86_400 * NS_PER_S
_STEP_NS = 3_600 * NS_PER_S
_ALIKE: dict[Table, tuple[str, ...]] = {
    tables.poses: ("person_id", "mode", "place_id"),
    tables.regions: ("region_id", "status"),
    tables.range_rounds: ("tag_id", "reporter_id"),
}
"""Tables that are thinned, and of which rows one is enough: no change of area or mode is thinned away."""


@dataclass(frozen=True, slots=True)
class RetentionRule:
    """Days after which one row a second is left, one a minute, none."""

    full_rate_days: float
    second_days: float
    keep_days: float


def check_rule(rule: RetentionRule) -> None:
    """Raises ConfigurationError where the ages are out of order."""
    if not rule.full_rate_days <= rule.second_days <= rule.keep_days:
        raise ConfigurationError(f"store: {rule}: out of order; allowed: full_rate_days <= second_days <= keep_days")


def retain(connection: Connection, rule: RetentionRule, now_ns: int) -> bool:
    """Do a step; whether there is more to do."""
    thinning = ((1, rule.full_rate_days), (60, rule.second_days))
    more = [_thin(connection, span_s, now_ns - round(days * _DAY_NS)) for span_s, days in thinning]
    return any([*more, _delete(connection, now_ns - round(rule.keep_days * _DAY_NS))])


def _thin(connection: Connection, span_s: int, before_ns: int) -> bool:
    marks = tables.thinned
    before_ns -= before_ns % _STEP_NS
    oldest_ns = _oldest_ns(connection, _ALIKE)
    since_ns = connection.scalar(select(marks.c.until_ns).where(marks.c.span_s == span_s).with_for_update())
    if oldest_ns is None:
        return False
    start_ns = max(since_ns or 0, oldest_ns - oldest_ns % _STEP_NS)
    if start_ns >= before_ns:
        return False
    end_ns = start_ns + _STEP_NS
    for table in _ALIKE:
        for of_person in _persons(connection, table):
            _thin_rows(connection, table, span_s, [*of_person, table.c.stamp_ns.between(start_ns, end_ns - 1)])
    if since_ns is None:
        connection.execute(marks.insert(), {"span_s": span_s, "until_ns": end_ns})
    else:
        connection.execute(update(marks).where(marks.c.span_s == span_s).values(until_ns=end_ns))
    return end_ns < before_ns


def _thin_rows(connection: Connection, table: Table, span_s: int, where: list[ColumnElement[bool]]) -> None:
    alike = [table.c[name] for name in _ALIKE[table]]
    key = [column for column in table.primary_key if column is not table.c.stamp_ns]
    span = table.c.stamp_ns // (span_s * NS_PER_S)
    first = select(*key, func.min(table.c.stamp_ns)).where(*where).group_by(*alike, span)
    connection.execute(delete(table).where(*where, tuple_(*key, table.c.stamp_ns).not_in(first)))
    connection.execute(update(table).where(*where).values(span_s=span_s))


def _delete(connection: Connection, before_ns: int) -> bool:
    kept = (*_ALIKE, tables.zone_events, tables.alarms)
    oldest_ns = _oldest_ns(connection, kept)
    if oldest_ns is None or oldest_ns >= before_ns:
        return False
    end_ns = min(oldest_ns + _STEP_NS, before_ns)
    for table in kept:
        for of_person in _persons(connection, table):
            connection.execute(delete(table).where(*of_person, table.c.stamp_ns < end_ns))
    connection.execute(delete(tables.writers).where(tables.writers.c.written_ns < end_ns))
    return end_ns < before_ns


def _persons(connection: Connection, table: Table) -> Iterator[list[ColumnElement[bool]]]:
    """Conditions that part a table so that each part lies along an index by time."""
    if table is not tables.poses:
        yield []
        return
    for person_id in connection.scalars(select(tables.people.c.id)).all():
        yield [table.c.person_id == person_id]


def _oldest_ns(connection: Connection, among: Iterable[Table]) -> int | None:
    found = [
        connection.scalar(select(func.min(table.c.stamp_ns)).where(*part))
        for table in among
        for part in _persons(connection, table)
    ]
    return min((stamp_ns for stamp_ns in found if stamp_ns is not None), default=None)
