"""A database that may take its time, for a keeper that may not: rows are to be acknowledged within a second."""

import threading
from collections.abc import Callable
from concurrent.futures import Future

from mine_loc_bringup.store.batch import Batch
from mine_loc_bringup.store.keeper import Database, DatabaseUnavailableError


class TimeLimited:
    """Gives up waiting for a batch after a while; the batch goes on by itself.

    Giving it again is safe, as a database commits each batch once. One thing is done at a time.
    """

    def __init__(self, database: Database, limit_s: float) -> None:
        self._database, self._limit_s = database, limit_s
        self._running: Future[None] | None = None

    @property
    def busy(self) -> bool:
        """Whether something is being done."""
        return self._running is not None and not self._running.done()

    def write(self, batch: Batch, now_ns: int) -> None:
        """See Database."""
        if self.busy:
            raise DatabaseUnavailableError("busy")
        try:
            self.begin(lambda: self._database.write(batch, now_ns)).result(self._limit_s)
        except TimeoutError:
            raise DatabaseUnavailableError(f"no answer within {self._limit_s:g} s") from None

    def begin(self, work: Callable[[], None]) -> Future[None]:
        """Do something else with the database, while it is not busy."""
        self._running = Future()
        # a daemon: a database that hangs does not keep the process
        threading.Thread(target=_settle, args=(self._running, work), daemon=True).start()
        return self._running


def _settle(future: Future[None], work: Callable[[], None]) -> None:
    try:
        work()
    except BaseException as error:  # noqa: BLE001 it is raised where it is waited for
        future.set_exception(error)
    else:
        future.set_result(None)
