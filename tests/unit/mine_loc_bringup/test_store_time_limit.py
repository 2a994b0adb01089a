"""A database that is slow keeps no row from being acknowledged, and gets each batch once."""

import threading

import pytest
from stored_walks import SPOOL_BYTES, pose

from mine_loc_bringup.store.keeper import DatabaseUnavailableError, Keeper
from mine_loc_bringup.store.spool import Spool
from mine_loc_bringup.store.time_limit import TimeLimited
from mine_loc_core.stamps import NS_PER_S

LIMIT_S = 0.02


class SlowDatabase:
    """Waits for leave before each commit."""

    def __init__(self):
        self.leave, self.done, self.numbers, self.down = threading.Event(), threading.Semaphore(0), [], False

    def write(self, batch, _now_ns):
        assert self.leave.wait(10.0)
        if self.down:
            raise DatabaseUnavailableError("down")
        if batch.number not in self.numbers:
            self.numbers.append(batch.number)
        self.done.release()


@pytest.fixture
def database():
    return SlowDatabase()


@pytest.fixture
def limited(database):
    return TimeLimited(database, LIMIT_S)


@pytest.fixture
def keeper(limited, tmp_path):
    return Keeper(limited, Spool(tmp_path / "spool", SPOOL_BYTES), list, 100, 10)


def test_rows_go_to_the_spool_while_the_database_is_slow_and_are_in_it_once(database, limited, keeper):
    keeper.put([pose(0)])
    keeper.flush(0, 0)
    assert (keeper.counts.acknowledged, keeper.counts.spooled) == (1, 1)
    assert keeper.database_problem == "no answer within 0.02 s"
    keeper.put([pose(1)])
    keeper.flush(0, 10 * NS_PER_S)
    assert (keeper.counts.acknowledged, keeper.spooled_batches, keeper.database_problem) == (2, 2, "busy")
    database.leave.set()
    assert database.done.acquire(timeout=10.0)
    limited._running.result(10.0)
    keeper.flush(0, 20 * NS_PER_S)
    assert (database.numbers, keeper.spooled_batches, keeper.database_problem) == ([1, 2], 0, "")


def test_a_database_that_answers_is_waited_for(database, keeper):
    database.leave.set()
    keeper.put([pose(0)])
    keeper.flush(0, 0)
    assert (database.numbers, keeper.counts.acknowledged, keeper.counts.spooled) == ([1], 1, 0)


def test_what_the_database_says_is_told(database, keeper):
    database.leave.set()
    database.down = True
    keeper.put([pose(0)])
    keeper.flush(0, 0)
    assert keeper.database_problem == "down"


def test_other_work_keeps_no_row_from_being_acknowledged(database, limited, keeper):
    database.leave.set()
    over = threading.Event()
    work = limited.begin(lambda: over.wait(10.0))
    keeper.put([pose(0)])
    keeper.flush(0, 0)
    assert (limited.busy, keeper.counts.spooled, keeper.database_problem) == (True, 1, "busy")
    over.set()
    work.result(10.0)
    keeper.flush(0, 10 * NS_PER_S)
    assert (limited.busy, database.numbers, keeper.spooled_batches) == (False, [1], 0)
