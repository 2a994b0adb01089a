"""What the store is asked: who was where, which way somebody went, how many were in each area."""

from collections.abc import Iterator
from dataclasses import dataclass

from sqlalchemy import Connection, Row, func, select

from mine_loc_bringup.store import tables
from mine_loc_bringup.store.records import NOWHERE
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_S, to_ns, to_s
from mine_loc_fusion.mode import Mode

LOOK_BACK_NS = 86_400 * NS_PER_S
"""Whoever was not heard of for a day is not reported as lost any more."""

_poses, _people, _places = tables.poses, tables.people, tables.places
_placed = _poses.c.mode.not_in(NOWHERE)


@dataclass(frozen=True, slots=True)
class Fix:
    """The last fix of a person: where (map, m), when, how sure (radius that holds them with probability 0.95, m).

    `lost`: it does not say where they were at the instant asked for, only where they were last known to be.
    """

    person: str
    stamp_ns: int
    age_s: float
    x_m: float | None
    y_m: float | None
    z_m: float | None
    ce95_m: float | None
    mode: Mode
    areas: tuple[str, ...]
    lost: bool


def who(connection: Connection, at_ns: int, max_age_s: float, area: str | None = None) -> list[Fix]:
    """Everybody heard of in the day before `at_ns`, or those of them who are, or were last known, in an area.

    Lost are those whose mode says so and whose fix is older than `max_age_s`, and the span that a thinned row stands
    for. Raises ConfigurationError for an area that nobody ever was in.
    """
    if area is not None:
        _area_id(connection, area)
    fixes = [
        fix for person in connection.execute(select(_people)) if (fix := _fix(connection, person, at_ns, max_age_s))
    ]
    return sorted((fix for fix in fixes if area is None or area in fix.areas), key=lambda fix: (fix.lost, fix.person))


# One question a person: asked for everybody at once, SQLite reads all of `poses` (measured: 13 s on ten million rows).
def _fix(connection: Connection, person: Row[tuple[int, str]], at_ns: int, max_age_s: float) -> Fix | None:
    own = _poses.c.person_id == person.id
    latest = (
        select(_poses, _places.c.name.label("place"))
        .join_from(_poses, _places)
        .where(own, _poses.c.stamp_ns <= at_ns, _poses.c.stamp_ns > at_ns - LOOK_BACK_NS)
        .order_by(_poses.c.stamp_ns.desc())
        .limit(1)
    )
    row = connection.execute(latest).one_or_none()
    if row is None:
        return None
    nowhere = row.mode in NOWHERE
    known = connection.execute(latest.where(_placed)).one_or_none() if nowhere else row
    shown = known or row
    age_s = to_s(at_ns - shown.stamp_ns)
    lost = nowhere or at_ns - row.stamp_ns > to_ns(max_age_s + row.span_s)
    areas = tuple(shown.place.split()) if known else ()
    x_m, y_m, z_m, ce95_m = (shown.x_m, shown.y_m, shown.z_m, shown.ce95_m) if known else (None,) * 4
    return Fix(person.name, shown.stamp_ns, age_s, x_m, y_m, z_m, ce95_m, Mode(row.mode), areas, lost)


@dataclass(frozen=True, slots=True)
class TrackPoint:
    """One row of a track, in the map."""

    stamp_ns: int
    x_m: float | None
    y_m: float | None
    z_m: float | None
    ce95_m: float | None
    mode: Mode
    areas: tuple[str, ...]
    span_s: int

    @property
    def placed(self) -> bool:
        """Whether it says where the person was."""
        return self.mode not in NOWHERE


def track(connection: Connection, person: str, from_ns: int, to_ns_: int) -> Iterator[TrackPoint]:
    """The rows of a person from one instant to another, by time. Raises ConfigurationError for an unknown name."""
    found = connection.execute(select(_people.c.id).where(_people.c.name == person)).scalar()
    if found is None:
        raise ConfigurationError(f"{person!r}: nobody of this name is in the store; allowed: {_names(connection)}")
    columns = [_poses.c[name] for name in ("stamp_ns", "x_m", "y_m", "z_m", "ce95_m", "mode")]
    asked = (
        select(*columns, _places.c.name.label("place"), _poses.c.span_s)
        .join_from(_poses, _places)
        .where(_poses.c.person_id == found, _poses.c.stamp_ns.between(from_ns, to_ns_))
        .order_by(_poses.c.stamp_ns)
    )
    for row in connection.execute(asked):
        where = (row.x_m, row.y_m, row.z_m, row.ce95_m)
        yield TrackPoint(row.stamp_ns, *where, Mode(row.mode), tuple(row.place.split()), row.span_s)


@dataclass(frozen=True, slots=True)
class HeadCount:
    """How many were in an area at the end of a period that begins at a stamp."""

    stamp_ns: int
    area: str
    people: int


def head_counts(
    connection: Connection, from_ns: int, to_ns_: int, step_s: float, area: str | None = None
) -> list[HeadCount]:
    """Heads in each area at the end of each period: by everybody's last fix in that period, the lost left out.

    Areas and periods without anybody do not occur. Raises ConfigurationError for an area that nobody ever was in.
    """
    step_ns = to_ns(step_s)
    period = (_poses.c.stamp_ns - from_ns) // step_ns
    in_time = (_poses.c.stamp_ns >= from_ns, _poses.c.stamp_ns < to_ns_)
    counts: dict[tuple[int, int], int] = {}
    for person_id in connection.scalars(select(_people.c.id)).all():
        last = (
            select(func.max(_poses.c.stamp_ns).label("stamp_ns"), period.label("period"))
            .where(_poses.c.person_id == person_id, *in_time)
            .group_by(period)
            .subquery()
        )
        asked = (
            select(last.c.period, _poses.c.place_id)
            .join(_poses, (_poses.c.stamp_ns == last.c.stamp_ns) & (_poses.c.person_id == person_id))
            .where(_placed)
        )
        for number, place_id in connection.execute(asked):
            counts[number, place_id] = counts.get((number, place_id), 0) + 1
    return _by_area(connection, counts, from_ns, step_ns, area)


def _by_area(
    connection: Connection, counts: dict[tuple[int, int], int], from_ns: int, step_ns: int, area: str | None
) -> list[HeadCount]:
    wanted = None if area is None else _area_id(connection, area)
    names = {row.id: row.name for row in connection.execute(select(tables.areas)) if wanted in {None, row.id}}
    heads: dict[tuple[int, str], int] = {}
    areas_of: dict[int, list[str]] = {}
    for place_id, area_id in connection.execute(select(tables.place_areas)):
        if area_id in names:
            areas_of.setdefault(place_id, []).append(names[area_id])
    for (number, place_id), people in counts.items():
        for name in areas_of.get(place_id, ()):
            heads[number, name] = heads.get((number, name), 0) + people
    return [HeadCount(from_ns + number * step_ns, name, heads[number, name]) for number, name in sorted(heads)]


def _area_id(connection: Connection, name: str) -> int:
    found = connection.scalar(select(tables.areas.c.id).where(tables.areas.c.name == name))
    if found is None:
        known = ", ".join(connection.scalars(select(tables.areas.c.name).order_by(tables.areas.c.name)))
        raise ConfigurationError(f"--zone: {name}: nobody ever was in it; allowed: {known or 'nothing yet'}")
    return int(found)


def _names(connection: Connection) -> str:
    return ", ".join(connection.scalars(select(_people.c.name).order_by(_people.c.name).limit(50))) or "nobody yet"
