"""The one schema of the store, for SQLite and PostgreSQL; docs/store.md describes it, `migrations` builds it.

Names of people and sets of areas are kept once and numbered. The poses' key leads with the person, so that the last
pose before an instant is one step down an index; all else is read by time.
"""

from sqlalchemy import (
    BigInteger,
    Boolean,
    Column,
    Dialect,
    Float,
    ForeignKey,
    Index,
    Integer,
    MetaData,
    SmallInteger,
    String,
    Table,
    TypeDecorator,
)

_SIGN, _ALL = 1 << 63, 1 << 64


class Uint64(TypeDecorator[int]):
    """A 64-bit id without sign in a column with one: its two's complement."""

    impl = BigInteger
    cache_ok = True

    def process_bind_param(self, value: int | None, dialect: Dialect) -> int | None:  # noqa: ARG002 of the interface
        """To the database."""
        return value - _ALL if value is not None and value >= _SIGN else value

    def process_result_value(self, value: int | None, dialect: Dialect) -> int | None:  # noqa: ARG002 of the interface
        """From the database."""
        return value + _ALL if value is not None and value < 0 else value


METADATA = MetaData()


def _names(table: str) -> Table:
    return Table(
        table,
        METADATA,
        Column("id", Integer, primary_key=True),
        Column("name", String, nullable=False, unique=True),
    )


def _stamp(name: str = "stamp_ns", *, primary_key: bool = False) -> "Column[int]":
    return Column(name, BigInteger, primary_key=primary_key, nullable=False, autoincrement=False)


def _number(name: str) -> "Column[float]":
    return Column(name, Float(53))


def _reference(table: str, name: str, *, primary_key: bool = False) -> "Column[int]":
    return Column(
        name, Integer, ForeignKey(f"{table}.id"), primary_key=primary_key, nullable=False, autoincrement=False
    )


people = _names("people")
areas = _names("areas")
places = _names("places")
"""Sets of areas, by their names in order, with a blank between."""

place_areas = Table(
    "place_areas",
    METADATA,
    _reference("places", "place_id", primary_key=True),
    _reference("areas", "area_id", primary_key=True),
)
poses = Table(
    "poses",
    METADATA,
    _reference("people", "person_id", primary_key=True),
    _stamp(primary_key=True),
    *map(_number, ("x_m", "y_m", "z_m", "yaw_rad", "variance_x_m2", "covariance_xy_m2", "variance_y_m2")),
    *map(_number, ("velocity_x_m_s", "velocity_y_m_s", "ce95_m")),
    Column("mode", SmallInteger, nullable=False),
    _number("since_uwb_s"),
    _reference("places", "place_id"),
    Column("span_s", SmallInteger, nullable=False),
    sqlite_with_rowid=False,
)
"""`span_s`: of so many seconds this row is left, 0 = not thinned."""

zone_events = Table(
    "zone_events",
    METADATA,
    _stamp(primary_key=True),
    _reference("people", "person_id", primary_key=True),
    _reference("areas", "area_id", primary_key=True),
    Column("event", String, primary_key=True),
    _number("dwell_s"),
)
Index("zone_events_by_person", zone_events.c.person_id, zone_events.c.stamp_ns)

regions = Table(
    "regions",
    METADATA,
    _stamp(primary_key=True),
    Column("region_id", BigInteger, primary_key=True, autoincrement=False),
    Column("person_id", Integer, ForeignKey("people.id")),
    *map(_number, ("x_m", "y_m", "radius_m", "probability", "confidence")),
    Column("status", SmallInteger, nullable=False),
    _stamp("last_heard_ns"),
    Column("galleries", String, nullable=False),
    Column("span_s", SmallInteger, nullable=False),
    sqlite_with_rowid=False,
)
alarms = Table(
    "alarms",
    METADATA,
    _stamp(primary_key=True),
    _reference("people", "person_id", primary_key=True),
    Column("zone", String, primary_key=True),
    Column("level", SmallInteger, primary_key=True, autoincrement=False),
    Column("latched", Boolean, primary_key=True),
    *map(_number, ("probability", "distance_m")),
)
range_rounds = Table(
    "range_rounds",
    METADATA,
    _stamp(primary_key=True),
    Column("tag_id", Uint64, primary_key=True, autoincrement=False),
    Column("reporter_id", Uint64, primary_key=True, autoincrement=False),
    Column("ranges", SmallInteger, nullable=False),
    *map(_number, ("los_fraction", "shortest_m", "longest_m")),
    Column("span_s", SmallInteger, nullable=False),
    sqlite_with_rowid=False,
)

writers = Table(
    "writers",
    METADATA,
    Column("id", String, primary_key=True),
    Column("last_batch", BigInteger, nullable=False),
    _stamp("written_ns"),
)
"""Up to which of its batches each run of a store is in here: a batch that is written twice counts once."""

thinned = Table(
    "thinned", METADATA, Column("span_s", Integer, primary_key=True, autoincrement=False), _stamp("until_ns")
)
"""Up to which stamp rows were thinned to one in `span_s` seconds."""
