"""The first schema."""

import sqlalchemy as sa
from alembic import op

revision = "0001"
down_revision = None


def _numbers(*names: str) -> list[sa.Column[float]]:
    return [sa.Column(name, sa.Float(53)) for name in names]


def _id(name: str, kind: type[sa.Integer] = sa.BigInteger) -> sa.Column[int]:
    return sa.Column(name, kind, nullable=False, autoincrement=False)


def _reference(table: str, name: str) -> sa.Column[int]:
    return sa.Column(name, sa.Integer, sa.ForeignKey(f"{table}.id"), nullable=False, autoincrement=False)


def upgrade() -> None:
    """Build it."""
    for name in ("people", "areas", "places"):
        op.create_table(
            name,
            sa.Column("id", sa.Integer, primary_key=True),
            sa.Column("name", sa.String, nullable=False, unique=True),
        )
    op.create_table(
        "place_areas",
        _reference("places", "place_id"),
        _reference("areas", "area_id"),
        sa.PrimaryKeyConstraint("place_id", "area_id"),
    )
    op.create_table(
        "poses",
        _reference("people", "person_id"),
        _id("stamp_ns"),
        *_numbers("x_m", "y_m", "z_m", "yaw_rad", "variance_x_m2", "covariance_xy_m2", "variance_y_m2"),
        *_numbers("velocity_x_m_s", "velocity_y_m_s", "ce95_m"),
        sa.Column("mode", sa.SmallInteger, nullable=False),
        *_numbers("since_uwb_s"),
        _reference("places", "place_id"),
        sa.Column("span_s", sa.SmallInteger, nullable=False),
        sa.PrimaryKeyConstraint("person_id", "stamp_ns"),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "zone_events",
        _id("stamp_ns"),
        _reference("people", "person_id"),
        _reference("areas", "area_id"),
        sa.Column("event", sa.String, nullable=False),
        *_numbers("dwell_s"),
        sa.PrimaryKeyConstraint("stamp_ns", "person_id", "area_id", "event"),
    )
    op.create_index("zone_events_by_person", "zone_events", ["person_id", "stamp_ns"])
    op.create_table(
        "regions",
        _id("stamp_ns"),
        _id("region_id"),
        sa.Column("person_id", sa.Integer, sa.ForeignKey("people.id")),
        *_numbers("x_m", "y_m", "radius_m", "probability", "confidence"),
        sa.Column("status", sa.SmallInteger, nullable=False),
        _id("last_heard_ns"),
        sa.Column("galleries", sa.String, nullable=False),
        sa.Column("span_s", sa.SmallInteger, nullable=False),
        sa.PrimaryKeyConstraint("stamp_ns", "region_id"),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "alarms",
        _id("stamp_ns"),
        _reference("people", "person_id"),
        sa.Column("zone", sa.String, nullable=False),
        _id("level", sa.SmallInteger),
        sa.Column("latched", sa.Boolean, nullable=False),
        *_numbers("probability", "distance_m"),
        sa.PrimaryKeyConstraint("stamp_ns", "person_id", "zone", "level", "latched"),
    )
    op.create_table(
        "range_rounds",
        _id("stamp_ns"),
        _id("tag_id"),
        _id("reporter_id"),
        sa.Column("ranges", sa.SmallInteger, nullable=False),
        *_numbers("los_fraction", "shortest_m", "longest_m"),
        sa.Column("span_s", sa.SmallInteger, nullable=False),
        sa.PrimaryKeyConstraint("stamp_ns", "tag_id", "reporter_id"),
        sqlite_with_rowid=False,
    )
    op.create_table(
        "writers",
        sa.Column("id", sa.String, primary_key=True),
        _id("last_batch"),
        _id("written_ns"),
    )
    op.create_table("thinned", _id("span_s", sa.Integer), _id("until_ns"), sa.PrimaryKeyConstraint("span_s"))
