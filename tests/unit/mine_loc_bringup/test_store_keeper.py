"""What acknowledged means, and what becomes of rows while database, spool or both take nothing."""

import resource
import sqlite3
from contextlib import closing, contextmanager

import pytest
from stored_walks import SPOOL_BYTES, START_NS, made_store, pose

from mine_loc_bringup.store.database import database_url, default_database, shown
from mine_loc_bringup.store.keeper import DatabaseUnavailableError, Keeper
from mine_loc_bringup.store.spool import Spool
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_S


class FakeDatabase:
    def __init__(self) -> None:
        self.batches, self.down = [], False

    def write(self, batch, _now_ns):
        if self.down:
            raise DatabaseUnavailableError("down")
        self.batches.append(batch)

    @property
    def stamps_s(self):
        return [(row.stamp_ns - START_NS) // NS_PER_S for batch in self.batches for row in batch.rows["poses"]]


def keeper_on(tmp_path, database, most_rows=100, batch_rows=2, spool_bytes=SPOOL_BYTES):
    return Keeper(database, Spool(tmp_path / "spool", spool_bytes), list, most_rows, batch_rows)


def test_a_row_is_acknowledged_when_its_batch_is_committed_not_before(tmp_path):
    keeper = keeper_on(tmp_path, database := FakeDatabase())
    keeper.put(pose(n) for n in range(5))
    assert (keeper.counts.acknowledged, keeper.waiting) == (0, 5)
    keeper.flush(0, 0)
    assert (keeper.counts.acknowledged, keeper.waiting, keeper.counts.spooled) == (5, 0, 0)
    assert [len(batch) for batch in database.batches] == [2, 2, 1]
    assert [batch.number for batch in database.batches] == [1, 2, 3]


def test_rows_go_to_the_spool_while_the_database_is_down_and_from_there_in_order(tmp_path):
    keeper = keeper_on(tmp_path, database := FakeDatabase())
    database.down = True
    keeper.put(pose(n) for n in range(3))
    keeper.flush(0, 0)
    assert (keeper.counts.acknowledged, keeper.counts.spooled, keeper.spooled_batches) == (3, 3, 2)
    assert keeper.database_problem == "down"
    database.down = False
    keeper.put([pose(3)])
    keeper.flush(0, NS_PER_S)  # not tried again yet
    assert database.batches == []
    keeper.put([pose(4)])
    keeper.flush(0, 2 * NS_PER_S)
    assert database.stamps_s == [0, 1, 2, 3, 4]
    assert (keeper.counts.acknowledged, keeper.spooled_batches, keeper.database_problem) == (5, 0, "")


def test_another_run_writes_what_the_one_before_left_in_the_spool(tmp_path):
    database = FakeDatabase()
    database.down = True
    first = keeper_on(tmp_path, database)
    first.put(pose(n) for n in range(3))
    first.close(0, 0)
    database.down = False
    second = keeper_on(tmp_path, database)
    second.put([pose(3)])
    second.flush(0, 0)
    assert database.stamps_s == [0, 1, 2, 3]
    assert len({batch.writer for batch in database.batches}) == 2
    assert second.counts.acknowledged == 1


def test_with_database_and_spool_down_rows_wait_in_memory_and_what_is_too_much_is_counted(tmp_path):
    keeper = keeper_on(tmp_path, database := FakeDatabase(), most_rows=4, spool_bytes=30)
    database.down = True
    keeper.put(pose(n) for n in range(4))
    keeper.flush(0, 0)
    assert keeper.counts.acknowledged == 0
    assert "are full" in keeper.spool_problem
    keeper.put(pose(n) for n in range(4, 9))
    assert (keeper.waiting, keeper.counts.lost) == (6, 3)
    database.down = False
    keeper.flush(0, 60 * NS_PER_S)
    assert database.stamps_s == [0, 1, 2, 3, 4, 5]
    assert (keeper.counts.acknowledged, keeper.spool_problem, keeper.waiting) == (6, "", 0)


def test_a_batch_stays_when_something_unforeseen_happens(tmp_path):
    keeper = keeper_on(tmp_path, database := FakeDatabase())
    keeper.put(pose(n) for n in range(3))
    write, database.write = database.write, lambda *_: 1 / 0
    with pytest.raises(ZeroDivisionError):
        keeper.flush(0, 0)
    assert (keeper.counts.acknowledged, keeper.waiting) == (0, 3)
    database.write = write
    keeper.flush(0, 0)
    assert database.stamps_s == [0, 1, 2]


def test_a_spool_of_another_version_is_refused_in_one_line(tmp_path):
    spool = Spool(tmp_path / "spool", 1000)
    spool.append(b"something else")
    spool.close()
    with pytest.raises(ConfigurationError, match="written by another version"):
        keeper_on(tmp_path, FakeDatabase(), spool_bytes=1000)


def test_nothing_is_lost_while_somebody_locks_the_database(tmp_path):
    file = tmp_path / "store.db"
    with made_store(f"sqlite:///{file}", tmp_path / "spool") as store:
        store.keep([pose(0)])
        with closing(sqlite3.connect(file, isolation_level=None)) as other:
            other.execute("BEGIN EXCLUSIVE")
            store.keep([pose(1)])
            assert store.keeper.database_problem == "database is locked"
            assert (store.keeper.counts.acknowledged, len(store.spool)) == (2, 1)
        store.keep([pose(2)])
        assert store.keeper.database_problem == ""
        assert store.count() == 3


def test_nothing_is_lost_while_the_database_may_not_grow(tmp_path):
    file = tmp_path / "store.db"
    with made_store(f"sqlite:///{file}", tmp_path / "spool") as store:
        store.keep([pose(0)])
        with store.engine.connect() as connection:
            pages = connection.exec_driver_sql("PRAGMA page_count").scalar()
            connection.exec_driver_sql(f"PRAGMA max_page_count = {pages}")
        store.keep([pose(n) for n in range(1, 500)])
        assert store.keeper.database_problem == "database or disk is full"
        assert store.keeper.counts.acknowledged == 500
        assert 0 < store.count() < 500
        with store.engine.connect() as connection:
            connection.exec_driver_sql("PRAGMA max_page_count = 1000000")
        store.keep()
        assert store.keeper.database_problem == ""
        assert store.count() == 500


@contextmanager
def files_no_larger_than(size_bytes):
    """What a full disk is to a process: writes that go beyond fail. SIGXFSZ is ignored by Python."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size_bytes, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_nothing_is_lost_on_a_full_disk_for_the_spool_has_its_room(tmp_path):
    file = tmp_path / "store.db"
    with made_store(f"sqlite:///{file}", tmp_path / "spool", batch_rows=1000) as store:
        store.keep([pose(0)])
        limit = SPOOL_BYTES  # the file of the spool is as large already
        with files_no_larger_than(limit):
            for start in range(1, 30_000, 1000):
                store.keep([pose(n) for n in range(start, start + 1000)])
                if store.keeper.database_problem:
                    break
            kept = store.keeper.counts.acknowledged
            assert store.keeper.database_problem in {"disk I/O error", "database or disk is full"}
            assert len(store.spool) == 1
            assert store.keeper.waiting == store.keeper.counts.lost == 0
        store.keep()
        assert store.keeper.database_problem == ""
        assert store.count() == kept == start + 1000
        with store.engine.connect() as connection:
            assert connection.exec_driver_sql("PRAGMA integrity_check").scalar() == "ok"


@pytest.mark.parametrize(
    "url", ["nonsense", "mysql://host/db", "sqlite://", "sqlite:///:memory:", "postgresql://host", "postgresql://h:x/d"]
)
def test_a_wrong_url_is_one_line(url):
    with pytest.raises(ConfigurationError, match=r"^database: .*; allowed: sqlite:///FILE or [^\n]*$"):
        database_url(url)


def test_the_default_is_a_file_of_the_user(monkeypatch, tmp_path):
    monkeypatch.delenv("MINE_LOC_DATABASE", raising=False)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert default_database() == f"sqlite:///{tmp_path}/mine_loc/store.db"
    monkeypatch.setenv("MINE_LOC_DATABASE", "postgresql://u:secret@h/d")
    assert shown(database_url("")) == "postgresql://u:***@h/d"
