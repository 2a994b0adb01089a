"""Kills the store under load again and again, and looks for what it had acknowledged.

    PYTHONPATH=tests python tests/graph/store_kills.py [--kills 50] [--seed 0]

Twenty people are published fifty times a second. The store is killed with SIGKILL at a random moment; every third time
the database is locked by somebody else, so that rows go to the spool. Afterwards it starts once more and is stopped
gently. Exit status 1 if an acknowledged row is missing, a row in the middle is, more than the last second is, or the
file is corrupt.
"""

import argparse
import random
import sqlite3
import sys
import tempfile
import time
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from pathlib import Path

from graph.domains import lent_domain
from graph.observer import Observer
from graph.processes import node_command, running
from graph.shuttle_site import write_shuttle_site
from mine_loc_interfaces.msg import PersonPose, PersonPoseArray

from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.qos import EVENTS

PEOPLE, PERIOD_S = 20, 0.02
_COMPONENT = "store: database"


@dataclass
class Killed:
    """One kill: what was sent, when, what was acknowledged, and what is there afterwards."""

    locked: bool
    acknowledged: int
    sent_ns: list[int]
    killed_ns: int
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

    def __init__(self, folder: Path, observer: Observer, domain: int) -> None:
        self.file = folder / "store.db"
        self._observer, self._domain, self._folder = observer, domain, folder
        self._publisher = observer.node.create_publisher(PersonPoseArray, "fused/poses", EVENTS)
        site = write_shuttle_site(folder / "site")
        parameters = {"site": site, "database": f"sqlite:///{self.file}", "spool_mb": 8, "flush_s": 0.2}
        self._command = node_command("mine_loc_bringup.nodes.store", parameters)

    def kill(self, *, after_s: float, locked: bool) -> Killed:
        with ExitStack() as stack:
            self._observer.status.clear()
            store = stack.enter_context(running(self._command, self._domain, self._folder / "store.log"))
            self._observer.wait_for(lambda: _COMPONENT in self._observer.status, what="the store")
            self._observer.wait_for(lambda: self._publisher.get_subscription_count() > 0, what="its subscription")
            if locked:
                lock = stack.enter_context(closing(sqlite3.connect(self.file, isolation_level=None)))
                lock.execute("BEGIN IMMEDIATE")
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
        return Killed(locked, acknowledged, sent_ns, killed_ns)

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
        with closing(sqlite3.connect(self.file)) as database:
            span = (killed.sent_ns[0], killed.killed_ns)
            asked = "SELECT stamp_ns, count(*) FROM poses WHERE stamp_ns BETWEEN ? AND ? GROUP BY stamp_ns"
            counts = dict(database.execute(asked, span))
            (healthy,) = database.execute("PRAGMA integrity_check").fetchone()
        killed.stored_ns = set(counts)
        wrong = [] if set(counts.values()) == {PEOPLE} else [f"some of {PEOPLE} people are missing"]
        return wrong + killed.problems() + ([] if healthy == "ok" else [healthy])


def _poses(stamp_ns: int) -> PersonPoseArray:
    people = [PersonPose(person=f"p{n}", mode=PersonPose.UWB_PDR, stamp=to_time(stamp_ns)) for n in range(PEOPLE)]
    array = PersonPoseArray(people=people)
    array.header.frame_id = "map"
    return array


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    chance, wrong = random.Random(arguments.seed), 0
    with lent_domain() as domain, tempfile.TemporaryDirectory() as folder:
        observer = Observer(domain)
        kills = Kills(Path(folder), observer, domain)
        kills.recover()  # makes the file
        runs = [kills.kill(after_s=chance.uniform(0.3, 2.5), locked=n % 3 == 2) for n in range(arguments.kills)]
        kills.recover()
        for number, killed in enumerate(runs, 1):
            problems = kills.look(killed)
            wrong += bool(problems)
            lost_s = (killed.killed_ns - max(killed.stored_ns, default=0)) / 1e9
            rows = f"{len(killed.sent_ns) * PEOPLE} sent, {killed.acknowledged} known acknowledged"
            there = f"{len(killed.stored_ns) * PEOPLE} there, last {lost_s:.2f} s before the kill"
            print(f"{number} {'locked' if killed.locked else ''}: {rows}, {there} {'; '.join(problems)}", flush=True)
        observer.close()
    print(f"{len(runs)} kills, {wrong} with something wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
