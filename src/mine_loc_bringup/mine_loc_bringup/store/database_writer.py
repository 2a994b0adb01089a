"""Batches into the database, each in one transaction, each once."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from alembic.util import CommandError
from sqlalchemy import Connection, Engine, Insert, Table, select, update
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.exc import DataError, IntegrityError, SQLAlchemyError

from mine_loc_bringup.store import tables
from mine_loc_bringup.store.batch import Batch
from mine_loc_bringup.store.database import migrate, reason
from mine_loc_bringup.store.keeper import DatabaseUnavailableError
from mine_loc_bringup.store.records import Record

_REFUSALS = (DataError, IntegrityError, OverflowError)
_Inserting = Callable[[Connection, Table, list[dict[str, Any]]], None]


class DatabaseWriter:
    """Writes batches of one or more writers. Not for several threads."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._migrated = False
        self._ids: dict[tuple[Table, str], int] = {}
        self.refused = 0
        """Rows that the database does not take for what they say."""
        self.last_refusal = ""

    def write(self, batch: Batch, now_ns: int) -> None:
        """Write and commit; a batch that is there already is left. Raises DatabaseUnavailableError."""
        try:
            self.prepare()
            try:
                self._write(batch, now_ns, _together)
            except _REFUSALS:
                self._write(batch, now_ns, self._one_by_one)
        except (SQLAlchemyError, CommandError, OSError) as error:
            raise DatabaseUnavailableError(reason(error)) from error

    def prepare(self) -> None:
        """Bring the schema up to date, once. Raises SQLAlchemyError or OSError."""
        if not self._migrated:
            migrate(self._engine)
            self._migrated = True

    def _write(self, batch: Batch, now_ns: int, insert: _Inserting) -> None:
        known, refused = dict(self._ids), self.refused
        try:
            with self._engine.begin() as connection:
                if self._begin(connection, batch, now_ns):
                    for name, records in batch.rows.items():
                        insert(connection, tables.METADATA.tables[name], self._values(connection, name, records))
        except BaseException:
            self._ids, self.refused = known, refused  # numbers that were given out are rolled back with the rest
            raise

    def _begin(self, connection: Connection, batch: Batch, now_ns: int) -> bool:
        table = tables.writers
        row = {"id": batch.writer, "last_batch": batch.number, "written_ns": now_ns}
        last = connection.scalar(select(table.c.last_batch).where(table.c.id == batch.writer).with_for_update())
        if last is None:
            connection.execute(table.insert(), row)
        elif last < batch.number:
            connection.execute(update(table).where(table.c.id == batch.writer), row)
        return last is None or last < batch.number

    def _values(self, connection: Connection, name: str, records: Sequence[Record]) -> list[dict[str, Any]]:
        rows = [record._asdict() for record in records]
        thinned = "span_s" in tables.METADATA.tables[name].c
        self._number(connection, tables.people, {row["person"] for row in rows if row.get("person")})
        if name == "poses":
            self._number_places(connection, {row["areas"] for row in rows})
        if name == "zone_events":
            self._number(connection, tables.areas, {row["area"] for row in rows})
        for row in rows:
            if "person" in row:
                row["person_id"] = self._ids.get((tables.people, row.pop("person")))
            if "areas" in row:
                row["place_id"] = self._ids[tables.places, " ".join(row.pop("areas"))]
            if "area" in row:
                row["area_id"] = self._ids[tables.areas, row.pop("area")]
            if thinned:
                row["span_s"] = 0
        return rows

    def _one_by_one(self, connection: Connection, table: Table, rows: list[dict[str, Any]]) -> None:
        """One that cannot be stored must not keep out those that can."""
        for row in rows:
            try:
                with connection.begin_nested():
                    _together(connection, table, [row])
            except _REFUSALS as error:
                self.refused += 1
                self.last_refusal = f"{table.name}: {reason(error)}"

    def _number_places(self, connection: Connection, places: Iterable[tuple[str, ...]]) -> None:
        new = {" ".join(place): place for place in places if (tables.places, " ".join(place)) not in self._ids}
        self._number(connection, tables.places, new)
        self._number(connection, tables.areas, {area for place in new.values() for area in place})
        pairs = [
            {"place_id": self._ids[tables.places, name], "area_id": self._ids[tables.areas, area]}
            for name, place in new.items()
            for area in place
        ]
        if pairs:
            _together(connection, tables.place_areas, pairs)

    def _number(self, connection: Connection, table: Table, names: Iterable[str]) -> None:
        for name in sorted({name for name in names if (table, name) not in self._ids}):
            connection.execute(_unless_there(connection, table), {"name": name})
            number = connection.scalar(select(table.c.id).where(table.c.name == name))
            self._ids[table, name] = int(number or 0)


def _together(connection: Connection, table: Table, rows: list[dict[str, Any]]) -> None:
    connection.execute(_unless_there(connection, table), rows)


def _unless_there(connection: Connection, table: Table) -> Insert:
    if connection.dialect.name == "postgresql":
        return postgresql.insert(table).on_conflict_do_nothing()
    return sqlite.insert(table).on_conflict_do_nothing()
