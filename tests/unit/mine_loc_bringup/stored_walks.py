"""Rows and stores for the tests of the store."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import func, select

from mine_loc_bringup.store import tables
from mine_loc_bringup.store.batch import Batch
from mine_loc_bringup.store.database import database_url, open_engine
from mine_loc_bringup.store.database_writer import DatabaseWriter
from mine_loc_bringup.store.keeper import Keeper
from mine_loc_bringup.store.records import Pose
from mine_loc_bringup.store.spool import Spool
from mine_loc_core.stamps import NS_PER_S, to_ns
from mine_loc_fusion.mode import Mode

START_NS = 1_700_000_000 * NS_PER_S
SPOOL_BYTES = 1_000_000


def pose(
    at_s: float, person: str = "fitter", mode: Mode = Mode.UWB_PDR, areas: Sequence[str] = (), **more: Any
) -> Pose:
    """A pose so many seconds after START_NS."""
    numbers = {"x_m": 1.0, "y_m": 2.0, "z_m": 1.0, "yaw_rad": 0.0, "variance_x_m2": 0.01, "covariance_xy_m2": 0.0}
    rest = {"variance_y_m2": 0.01, "velocity_x_m_s": 0.0, "velocity_y_m_s": 0.0, "ce95_m": 0.25, "since_uwb_s": 0.1}
    row = numbers | rest | {"stamp_ns": START_NS + to_ns(at_s), "mode": int(mode), "areas": tuple(areas)} | more
    return Pose(person=person, **row)


class MadeStore:
    """A store on a database, without a node."""

    def __init__(self, url: str, spool: Path, *, most_rows: int = 10_000, batch_rows: int = 100) -> None:
        self.url = url
        self.engine = open_engine(database_url(url), writing=True)
        self.writer = DatabaseWriter(self.engine)
        self.spool = Spool(spool, SPOOL_BYTES)
        self.keeper = Keeper(self.writer, self.spool, list, most_rows, batch_rows)
        self._steady_ns = 0

    def keep(self, rows: Sequence[Any] = ()) -> None:
        """Put rows and flush, long after the flush before."""
        self._steady_ns += 60 * NS_PER_S
        self.keeper.put(rows)
        self.keeper.flush(START_NS, self._steady_ns)

    def write(self, rows: Sequence[Any], number: int = 1, writer: str = "w") -> None:
        """Past spool and queue."""
        self.writer.write(Batch.of(writer, number, rows), START_NS)

    def count(self, table: str = "poses") -> int:
        with self.engine.connect() as connection:
            return int(connection.scalar(select(func.count()).select_from(tables.METADATA.tables[table])) or 0)

    def rows(self, table: str) -> list[Any]:
        with self.engine.connect() as connection:
            return list(connection.execute(select(tables.METADATA.tables[table])))

    def close(self) -> None:
        self.spool.close()
        self.engine.dispose()


@contextmanager
def made_store(url: str, spool: Path, **more: Any) -> Iterator[MadeStore]:
    store = MadeStore(url, spool, **more)
    try:
        yield store
    finally:
        store.close()
