"""Kills the store under load again and again, and looks for what it had acknowledged.

    PYTHONPATH=tests python tests/graph/store_kills.py [--kills 50] [--seed 0] [--engine postgresql]

Twenty people are published fifty times a second. The store is killed with SIGKILL at a random moment; every third time
its database is withheld, so that rows go to the spool: SQLite's is locked by somebody else, PostgreSQL's server dies.
Afterwards the store starts once more and is stopped gently. Exit status 1 if an acknowledged row is missing, a row in
the middle is, more than the last second is, or the database is corrupt.
"""

import argparse
import random
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from graph.domains import lent_domain
from graph.observer import Observer
from graph.processes import node_command, running
from graph.shuttle_site import write_shuttle_site
from mine_loc_interfaces.msg import PersonPose, PersonPoseArray
from postgresql_server import PostgresqlServer, postgresql_server, why_not
from sqlalchemy import create_engine, text

from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.qos import EVENTS

PEOPLE, PERIOD_S = 20, 0.02
_COMPONENT = "store: database"


class Sqlite:
    """A file."""

    def __init__(self, folder: Path) -> None:
        self.url = f"sqlite:///{folder / 'store.db'}"
        self.engine = create_engine(self.url)

    @contextmanager
    def withheld(self) -> Iterator[None]:
        """Somebody else has the lock."""
        with self.engine.connect() as connection:
            connection.exec_driver_sql("BEGIN IMMEDIATE")
            yield

    def problems(self) -> list[str]:
        """What is wrong with the file."""
        with self.engine.connect() as connection:
            said = connection.exec_driver_sql("PRAGMA integrity_check").scalar_one()
        return [] if said == "ok" else [said]


class Postgresql:
    """A server."""

    def __init__(self, server: PostgresqlServer) -> None:
        self._server = server
        self.url = server.url
        self.engine = create_engine(server.url.replace("postgresql:", "postgresql+psycopg:"), pool_pre_ping=True)

    @contextmanager
    def withheld(self) -> Iterator[None]:
        """The server dies."""
        self._server.stop()
        try:
            yield
        finally:
            self._server.start()

    def problems(self) -> list[str]:
        """None but what an exception says: every page of the tables and of their indices is read."""
        with self.engine.connect() as connection:
            connection.execute(text("CREATE EXTENSION IF NOT EXISTS amcheck"))
            connection.execute(text(_AMCHECK)).all()
            found = connection.execute(text(_VERIFY_HEAP)).scalars().all()
        return list(found)


_AMCHECK = """SELECT bt_index_check(indexrelid, true) FROM pg_index JOIN pg_class ON pg_class.oid = indrelid
              WHERE relnamespace = 'public'::regnamespace"""
_VERIFY_HEAP = """SELECT msg FROM pg_class, verify_heapam(pg_class.oid)
                  WHERE relnamespace = 'public'::regnamespace AND relkind = 'r'"""


@dataclass
class Killed:
    """One kill: what was sent, when, what was acknowledged, and what is there afterwards."""

    withheld: bool
    acknowledged: int
    sent_ns: list[int]
    killed_ns: int
    output: str
    stored_ns: set[int] = field(default_factory=set)

    def problems(self) -> list[str]:
        stored = sorted(self.stored_ns)
        found = []
        if len(stored) * PEOPLE < self.acknowledged:
            found.append(f"{self.acknowledged} rows acknowledged, {len(stored) * PEOPLE} there")
        if stored and stored != [stamp for stamp in self.sent_ns if stored[0] <= stamp <= stored[-1]]:
            found.append("rows are missing in the middle")
        if not stored or self.killed_ns - stored[-1] > 1_000_000_000:
            found.append(f"the last {(self.killed_ns - (stored or [0])[-1]) / 1e9:.1f} s are missing")
        return found


class Kills:
    """A database and the store that writes to it."""

    def __init__(self, folder: Path, observer: Observer, domain: int, database: Sqlite | Postgresql) -> None:
        self._observer, self._domain, self._folder, self._database = observer, domain, folder, database
        self._publisher = observer.node.create_publisher(PersonPoseArray, "fused/poses", EVENTS)
        site, spool = write_shuttle_site(folder / "site"), folder / "store.spool"
        parameters = {"site": site, "database": database.url, "spool": spool, "spool_mb": 8, "flush_s": 0.2}
        self._command = node_command("mine_loc_bringup.nodes.store", parameters)

    def kill(self, *, after_s: float, withheld: bool) -> Killed:
        with ExitStack() as stack:
            self._observer.status.clear()
            store = stack.enter_context(running(self._command, self._domain, self._folder / "store.log"))
            self._observer.wait_for(lambda: _COMPONENT in self._observer.status, what="the store")
            self._observer.wait_for(lambda: self._publisher.get_subscription_count() > 0, what="its subscription")
            if withheld:
                stack.enter_context(self._database.withheld())
            sent_ns: list[int] = []
            until_s = time.monotonic() + after_s
            acknowledged = 0
            while time.monotonic() < until_s or not acknowledged:
                sent_ns.append(time.time_ns())
                self._publisher.publish(_poses(sent_ns[-1]))
                next_s = time.monotonic() + PERIOD_S
                self._observer.wait_for(lambda: time.monotonic() >= next_s)  # noqa: B023
                acknowledged = self._observer.value(_COMPONENT, "acknowledged")
            store.process.kill()
            killed_ns = time.time_ns()
            store.ends()
        return Killed(withheld, acknowledged, sent_ns, killed_ns, store.output)

    def recover(self) -> None:
        """Start the store until its spool is empty, and stop it."""
        self._observer.status.clear()
        with running(self._command, self._domain, self._folder / "store.log") as store:
            self._observer.wait_for(
                lambda: (
                    _COMPONENT in self._observer.status
                    and not self._observer.value(_COMPONENT, "spooled_batches")
                    and self._observer.level(_COMPONENT) == 0
                ),
                what="an empty spool",
            )
            assert store.alive
            store.stop()

    def look(self, killed: Killed) -> list[str]:
        asked = text("SELECT stamp_ns, count(*) FROM poses WHERE stamp_ns BETWEEN :first AND :last GROUP BY stamp_ns")
        with self._database.engine.connect() as connection:
            rows = connection.execute(asked, {"first": killed.sent_ns[0], "last": killed.killed_ns}).all()
        killed.stored_ns = {stamp_ns for stamp_ns, _ in rows}
        wrong = [] if {count for _, count in rows} == {PEOPLE} else [f"some of {PEOPLE} people are missing"]
        return wrong + killed.problems() + self._database.problems()


def _poses(stamp_ns: int) -> PersonPoseArray:
    people = [PersonPose(person=f"p{n}", mode=PersonPose.UWB_PDR, stamp=to_time(stamp_ns)) for n in range(PEOPLE)]
    array = PersonPoseArray(people=people)
    array.header.frame_id = "map"
    return array


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--engine", choices=["sqlite", "postgresql"], default="sqlite")
    arguments = parser.parse_args()
    if arguments.engine == "postgresql" and (reason := why_not()):
        parser.error(reason)
    chance, wrong = random.Random(arguments.seed), 0
    with ExitStack() as stack:
        domain = stack.enter_context(lent_domain())
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        of_server = arguments.engine == "postgresql"
        database = Postgresql(stack.enter_context(postgresql_server())) if of_server else Sqlite(folder)
        observer = Observer(domain)
        stack.callback(observer.close)
        kills = Kills(folder, observer, domain, database)
        kills.recover()  # makes the tables
        runs = [kills.kill(after_s=chance.uniform(0.3, 2.5), withheld=n % 3 == 2) for n in range(arguments.kills)]
        kills.recover()
        for number, killed in enumerate(runs, 1):
            problems = kills.look(killed)
            wrong += bool(problems)
            lost_s = (killed.killed_ns - max(killed.stored_ns, default=0)) / 1e9
            rows = f"{len(killed.sent_ns) * PEOPLE} sent, {killed.acknowledged} known acknowledged"
            there = f"{len(killed.stored_ns) * PEOPLE} there, last {lost_s:.2f} s before the kill"
            print(f"{number} {'withheld' * killed.withheld}: {rows}, {there}", flush=True)
            if problems:
                print("; ".join(problems), killed.output, sep="\n", flush=True)
    print(f"{len(runs)} kills, {wrong} with something wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
