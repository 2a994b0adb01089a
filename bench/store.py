"""The store: what a message and a row cost, and how long questions take on ten million rows; writes
bench/results/store.json.

    python bench/store.py [--rows 10000000] [--json FILE] [--database URL]

Rows are made up with a fixed seed: 100 people go from area to area every ten minutes, a row a second each. Without
--database the store is a SQLite file in the folder for temporary files; with it, an empty PostgreSQL database. Costs
are processor time of this process, medians of several runs with the smallest and the largest; times of questions are
wall time.
"""

import argparse
import json
import platform
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import sqlalchemy
from mine_loc_interfaces.msg import PersonPose, PersonPoseArray, UwbRange, UwbRangeArray
from rich.progress import track as progress

from mine_loc_bringup.nodes.store_records import to_poses, to_range_round
from mine_loc_bringup.store import tables
from mine_loc_bringup.store.areas import AreaWatch
from mine_loc_bringup.store.batch import Batch
from mine_loc_bringup.store.database import asked, database_url, open_engine
from mine_loc_bringup.store.database_writer import DatabaseWriter
from mine_loc_bringup.store.keeper import DatabaseUnavailableError, Keeper
from mine_loc_bringup.store.queries import head_counts, track, who
from mine_loc_bringup.store.records import Pose
from mine_loc_bringup.store.spool import Spool
from mine_loc_core.site import load_site
from mine_loc_core.stamps import NS_PER_S

RESULTS = Path(__file__).parent / "results" / "store.json"
SITE = Path(__file__).parents[1] / "config" / "example_mine"
PEOPLE, AREAS, RUNS, BATCH_ROWS, SEED = 100, 20, 5, 5000, 1
START_NS = 1_700_000_000 * NS_PER_S


class Down:
    """A database that takes nothing."""

    def write(self, batch: Batch, _now_ns: int) -> None:
        raise DatabaseUnavailableError(f"{len(batch)} rows refused")


def made_poses(rows: int, start_ns: int) -> list[Pose]:
    chance = np.random.default_rng(SEED)
    east = chance.uniform(0.0, 90.0, rows)
    numbers = (1.0, 0.0, 0.04, 0.001, 0.05, 0.8, 0.1, 0.52, 2, 0.1)
    return [
        Pose(f"p{n % PEOPLE}", start_ns + n // PEOPLE * NS_PER_S // 10, float(x), 0.5, *numbers)
        for n, x in enumerate(east)
    ]


def spread(measure: Callable[[int], float]) -> dict[str, Any]:
    values = [measure(run) for run in range(RUNS)]
    return {"median": median(values), "least": min(values), "most": max(values), "runs": RUNS}


def cpu_us(work: Callable[[], object], times: int) -> float:
    started = time.process_time()
    for _ in range(times):
        work()
    return (time.process_time() - started) / times * 1e6


def message_costs() -> dict[str, Any]:
    poses = PersonPoseArray(people=[PersonPose(person="fitter", mode=PersonPose.UWB_PDR)])
    ranges = UwbRangeArray(ranges=[UwbRange(anchor_id=n, los_probability=0.9) for n in range(6)])
    return {
        "pose_message_us": spread(lambda _: cpu_us(lambda: to_poses(poses), 3000)),
        "range_round_of_6_us": spread(lambda _: cpu_us(lambda: to_range_round(ranges), 3000)),
    }


def row_rates(url: str, folder: Path) -> dict[str, Any]:
    """Rows a second through the keeper with areas and events: into the database, and into the spool."""
    engine = open_engine(database_url(url), writing=True)
    site = load_site(SITE)
    found = {}
    for name, database in (("database", DatabaseWriter(engine)), ("spool", Down())):
        spool = Spool(folder / name, 256_000_000)
        keeper = Keeper(database, spool, AreaWatch(site, 0.5).arrange, 10**6, BATCH_ROWS)

        def rate(run: int, keeper: Keeper = keeper, *, wall: bool) -> float:
            rows = made_poses(50_000, START_NS - (run + 1 + 100 * wall) * 10**15)
            clock = time.perf_counter if wall else time.process_time
            before, started = keeper.counts.acknowledged, clock()
            keeper.put(rows)
            keeper.flush(START_NS, time.monotonic_ns())
            return (keeper.counts.acknowledged - before) / (clock() - started)

        found[f"{name}_rows_per_cpu_s"] = spread(lambda run, rate=rate: rate(run, wall=False))
        found[f"{name}_rows_per_s"] = spread(lambda run, rate=rate: rate(run, wall=True))
        spool.close()
    engine.dispose()
    return found


def fill(url: str, rows: int) -> None:
    """Rows a second apart for everybody, past the writer: the making is not what is measured."""
    engine = open_engine(database_url(url), writing=True, patient=True)
    DatabaseWriter(engine).write(Batch.of("bench", 1, [_of_area(n) for n in range(max(PEOPLE, AREAS))]), START_NS)
    with engine.connect() as connection:
        people = [row.id for row in connection.execute(sqlalchemy.select(tables.people)) if row.name.startswith("q")]
        places = [row.id for row in connection.execute(sqlalchemy.select(tables.places)) if row.name.startswith("area")]
    part = 100_000
    for first in progress(range(0, rows, part), description="rows"):
        with engine.begin() as connection:
            _insert(connection, list(_rows(first, min(part, rows - first), people, places)))
    with engine.connect() as connection:
        connection.execution_options(isolation_level="AUTOCOMMIT") if engine.dialect.name == "postgresql" else None
        connection.exec_driver_sql("ANALYZE")
    engine.dispose()


def _of_area(number: int) -> Pose:
    rest = (1.0, 0.0, 0.04, 0.001, 0.05, 0.8, 0.1, 0.52, 2, 0.1)
    return Pose(f"q{number % PEOPLE}", START_NS - NS_PER_S, 1.0, 2.0, *rest, areas=(f"area{number % AREAS}",))


def _rows(first: int, count: int, people: list[int], places: list[int]) -> Iterator[tuple[Any, ...]]:
    east = np.random.default_rng((SEED, first)).uniform(0.0, 90.0, count).tolist()
    for n, x in enumerate(east, first):
        second, person = divmod(n, PEOPLE)
        place = places[(second // 600 + person * 7) % AREAS]
        numbers = (x, 0.5, 1.0, 0.0, 0.04, 0.001, 0.05, 0.8, 0.1, 0.52)
        yield (people[person], START_NS + second * NS_PER_S, *numbers, 2, 0.1, place, 1)


def _insert(connection: sqlalchemy.Connection, rows: list[tuple[Any, ...]]) -> None:
    cursor = connection.connection.cursor()
    names = ", ".join(column.name for column in tables.poses.columns)
    if connection.dialect.name == "postgresql":
        with cursor.copy(f"COPY poses ({names}) FROM STDIN") as copy:
            for row in rows:
                copy.write_row(row)
    else:
        cursor.executemany(f"INSERT INTO poses ({names}) VALUES ({', '.join('?' * len(rows[0]))})", rows)


def question_times(url: str, rows: int) -> dict[str, Any]:
    span_ns = rows // PEOPLE * NS_PER_S
    instants = np.random.default_rng(SEED).integers(START_NS + span_ns // 100, START_NS + span_ns, RUNS).tolist()
    hour_ns = 3600 * NS_PER_S

    def timed(ask: Callable[[sqlalchemy.Connection, int], object]) -> dict[str, Any]:
        def once(run: int) -> float:
            with asked(url) as connection:
                started = time.perf_counter()
                assert ask(connection, instants[run])
                return (time.perf_counter() - started) * 1e3

        return spread(once)

    return {
        "who_ms": timed(lambda c, at: who(c, at, 10.0)),
        "who_in_area_ms": timed(lambda c, at: who(c, at, 10.0, "area3")),
        "track_of_an_hour_ms": timed(lambda c, at: list(track(c, "q5", at - hour_ns, at))),
        "headcount_of_an_hour_ms": timed(lambda c, at: head_counts(c, at - hour_ns, at, 600.0)),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rows", type=int, default=10_000_000)
    parser.add_argument("--json", type=Path, default=RESULTS)
    parser.add_argument("--database", default="")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        url = arguments.database or f"sqlite:///{folder / 'store.db'}"
        found: dict[str, Any] = message_costs() | row_rates(url, folder)
        fill(url, arguments.rows)
        found |= {"rows": arguments.rows, "people": PEOPLE, "seed": SEED} | question_times(url, arguments.rows)
        file = folder / "store.db"
        found["bytes_per_row"] = round(file.stat().st_size / arguments.rows, 1) if file.exists() else None
    found |= {"engine": url.partition(":")[0], "python": platform.python_version()}
    arguments.json.parent.mkdir(parents=True, exist_ok=True)
    arguments.json.write_text(json.dumps(found, indent=2) + "\n", "utf-8")
    print(json.dumps(found, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
