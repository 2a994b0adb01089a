"""The store's schema, writing, queries and retention, the same on SQLite and PostgreSQL."""

import uuid
from collections.abc import Iterator

import postgresql_server
import psycopg
import pytest
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from stored_walks import START_NS, MadeStore, made_store, pose

from mine_loc_bringup.store import tables
from mine_loc_bringup.store.database import asked, migrate
from mine_loc_bringup.store.database_writer import DatabaseWriter
from mine_loc_bringup.store.queries import head_counts, track, who
from mine_loc_bringup.store.records import Alarm, RangeRound, Region, ZoneEvent
from mine_loc_bringup.store.retention import RetentionRule, check_rule, retain
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_S
from mine_loc_fusion.mode import Mode

DAY_NS = 86_400 * NS_PER_S


@pytest.fixture(scope="module")
def server() -> Iterator[postgresql_server.PostgresqlServer]:
    if reason := postgresql_server.why_not():
        pytest.skip(reason)
    with postgresql_server.postgresql_server() as server:
        yield server


@pytest.fixture(params=["sqlite", "postgresql"])
def store(request, tmp_path) -> Iterator[MadeStore]:
    url = f"sqlite:///{tmp_path / 'store.db'}"
    if request.param == "postgresql":
        server = request.getfixturevalue("server")
        name = f"t{uuid.uuid4().hex}"
        with psycopg.connect(server.url, autocommit=True) as connection:
            connection.execute(f"CREATE DATABASE {name}")
        url = server.url.replace("/postgres?", f"/{name}?")
    with made_store(url, tmp_path / "spool") as store:
        yield store


def test_the_migrations_build_the_schema_that_is_written(store):
    migrate(store.engine)
    migrate(store.engine)  # and once is enough
    with store.engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), tables.METADATA) == []


def test_a_schema_of_a_later_version_is_left_alone_and_rows_wait(store):
    migrate(store.engine)
    with store.engine.begin() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = '9999'")
    store.keep([pose(0.0)])
    assert store.keeper.database_problem == "Can't locate revision identified by '9999'"
    assert store.keeper.counts.acknowledged == store.keeper.counts.spooled == 1
    with pytest.raises(ConfigurationError, match="schema 9999; allowed: 0001"), asked(store.url):
        pass
    with store.engine.begin() as connection:
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = '0001'")
    store.keep()
    assert store.count() == 1


def test_every_kind_of_row_comes_back_as_it_was(store):
    tag = 2**64 - 2
    store.keep(
        [
            pose(0.0, areas=("face", "main")),
            ZoneEvent(START_NS, "fitter", "face", "enter", None),
            Region(START_NS, 4_000_000_000, "", 1.0, 2.0, 3.0, 0.9, None, 1, START_NS - 5, "main"),
            Alarm(START_NS, "fitter", "round_car", 3, True, 0.9, 1.5),
            RangeRound(START_NS, tag, 7, 4, 0.75, 1.0, 9.0),
        ]
    )
    assert store.keeper.counts.acknowledged == 5
    assert store.rows("range_rounds") == [(START_NS, tag, 7, 4, 0.75, 1.0, 9.0, 0)]
    assert store.rows("alarms") == [(START_NS, 1, "round_car", 3, True, 0.9, 1.5)]
    assert store.rows("regions")[0][:5] == (START_NS, 4_000_000_000, None, 1.0, 2.0)
    assert store.rows("zone_events")[0].event == "enter"
    (row,) = store.rows("poses")
    assert (row.stamp_ns, row.x_m, row.y_m, row.ce95_m, row.mode, row.span_s) == (START_NS, 1.0, 2.0, 0.25, 2, 0)
    assert [name for _, name in store.rows("areas")] == ["face", "main"]


def test_a_batch_that_is_written_again_counts_once(store):
    store.write([ZoneEvent(START_NS, "fitter", "face", "enter", None)], number=1)
    store.write([ZoneEvent(START_NS + 1, "fitter", "face", "leave", 1.0)], number=1)
    assert [row.event for row in store.rows("zone_events")] == ["enter"]
    store.write([ZoneEvent(START_NS + 1, "fitter", "face", "leave", 1.0)], number=2)
    store.write([ZoneEvent(START_NS + 2, "fitter", "face", "enter", None)], number=1, writer="another")
    assert store.count("zone_events") == 3


def test_two_stores_give_a_name_one_number(store):
    other = DatabaseWriter(store.engine)
    store.write([pose(0.0, "a", areas=("x",)), pose(0.0, "b", areas=("x",))])
    store.writer, mine = other, store.writer
    store.write([pose(1.0, "b", areas=("x",)), pose(1.0, "c", areas=("x", "y"))], writer="other")
    store.writer = mine
    store.write([pose(2.0, "c", areas=("x", "y"))], number=2)
    assert sorted(name for _, name in store.rows("people")) == ["a", "b", "c"]
    assert sorted(name for _, name in store.rows("places")) == ["x", "x y"]
    assert store.count() == 5


def test_a_row_that_cannot_be_stored_is_counted_and_keeps_no_other_out(store):
    store.keep([pose(0.0), pose(1.0, person=""), pose(2.0)])
    assert store.count() == 2
    assert store.writer.refused == 1
    assert store.writer.last_refusal.startswith("poses: ")


def test_who_says_where_how_old_and_how_sure(store):
    store.keep([pose(0.0, areas=("face", "main")), pose(5.0, areas=("main",)), pose(4.0, "miner", areas=("face",))])
    with asked(store.url) as connection:
        fitter, miner = who(connection, START_NS + 6 * NS_PER_S, 10.0)
        assert (fitter.person, fitter.age_s, fitter.ce95_m, fitter.areas, fitter.lost) == (
            "fitter", 1.0, 0.25, ("main",), False,
        )  # fmt: skip
        assert (miner.person, miner.age_s) == ("miner", 2.0)
        assert [fix.person for fix in who(connection, START_NS + 6 * NS_PER_S, 10.0, "face")] == ["miner"]
        assert [fix.age_s for fix in who(connection, START_NS, 10.0)] == [0.0]
        assert who(connection, START_NS - 1, 10.0) == []
        with pytest.raises(ConfigurationError, match="--zone: hall: nobody ever was in it; allowed: face, main"):
            who(connection, START_NS, 10.0, "hall")


def test_who_says_lost_where_the_fix_is_old_or_says_so_itself(store):
    lost = pose(3.0, "miner", Mode.LOST, x_m=99.0, ce95_m=80.0)
    store.keep([pose(0.0, areas=("face",)), pose(1.0, "miner", areas=("face",), x_m=7.0), lost])
    with asked(store.url) as connection:
        fitter, miner = who(connection, START_NS + 11 * NS_PER_S, 10.0, "face")
        assert (fitter.lost, fitter.age_s, fitter.areas) == (True, 11.0, ("face",))
        assert (miner.lost, miner.age_s, miner.x_m, miner.mode) == (True, 10.0, 7.0, Mode.LOST)
        assert [fix.lost for fix in who(connection, START_NS + 2 * NS_PER_S, 10.0)] == [False, False]
        assert who(connection, START_NS + 11 * NS_PER_S + DAY_NS, 10.0) == []


def test_a_track_is_the_rows_of_one_person_in_order(store):
    store.keep([pose(2.0), pose(1.0), pose(3.0), pose(1.5, "miner"), pose(2.5, mode=Mode.LOST)])
    with asked(store.url) as connection:
        points = list(track(connection, "fitter", START_NS + NS_PER_S, START_NS + 5 * NS_PER_S // 2))
        assert [(point.stamp_ns - START_NS) / 1e9 for point in points] == [1.0, 2.0, 2.5]
        assert [point.placed for point in points] == [True, True, False]
        with pytest.raises(ConfigurationError, match=r"'nobody': nobody of this name .* allowed: fitter, miner"):
            list(track(connection, "nobody", 0, 1))


def test_heads_are_counted_at_the_end_of_each_period(store):
    walk = [pose(1.0, areas=("a",)), pose(9.0, areas=("b",)), pose(15.0, areas=("b", "c")), pose(19.0, mode=Mode.LOST)]
    store.keep([*walk, pose(5.0, "miner", areas=("b",)), pose(12.0, "miner", areas=("b",))])
    with asked(store.url) as connection:
        counts = head_counts(connection, START_NS, START_NS + 20 * NS_PER_S, 10.0)
        assert [((c.stamp_ns - START_NS) / 1e9, c.area, c.people) for c in counts] == [(0.0, "b", 2), (10.0, "b", 1)]
        assert head_counts(connection, START_NS, START_NS + 20 * NS_PER_S, 10.0, "c") == []


def test_old_rows_are_thinned_and_at_last_deleted(store):
    start_s = -(START_NS / 1e9) % 3600 + 0.05  # within the first second of an hour
    ten_minutes = [pose(start_s + n * 0.1, areas=("a",)) for n in range(6000)]
    passing = pose(start_s + 30.05, areas=("b",))
    store.keep([*ten_minutes, passing, RangeRound(START_NS, 1, 1, 4, None, 1.0, 2.0)])
    rule = RetentionRule(full_rate_days=1.0, second_days=2.0, keep_days=3.0)

    def retained_after(days: float) -> list[tuple[int, int]]:
        now_ns = START_NS + round(days * DAY_NS) + 2 * 3600 * NS_PER_S
        for _ in range(200):
            with store.engine.begin() as connection:
                more = retain(connection, rule, now_ns)
            if not more:
                return [(row.stamp_ns, row.span_s) for row in store.rows("poses")]
        raise AssertionError("no end")

    assert len(retained_after(0.5)) == 6001
    seconds = retained_after(1.0)
    assert len(seconds) == 600 + 1
    assert {span_s for _, span_s in seconds} == {1}
    assert (passing.stamp_ns, 1) in seconds
    with asked(store.url) as connection:
        assert not who(connection, seconds[50][0] + 10_900_000_000, 10.0)[0].lost
    minutes = retained_after(2.0)
    assert len(minutes) == 10 + 1
    assert (passing.stamp_ns, 60) in minutes
    assert retained_after(3.0) == []
    assert store.count("range_rounds") == 0
    assert store.count("people") == 1


def test_ages_of_retention_must_be_in_order():
    with pytest.raises(ConfigurationError, match="full_rate_days <= second_days <= keep_days"):
        check_rule(RetentionRule(30.0, 10.0, 100.0))


def test_rows_wait_in_the_spool_while_postgresql_is_down(server, tmp_path):
    with made_store(server.url, tmp_path / "spool") as store:
        store.keep([pose(0.0)])
        server.stop()
        try:
            store.keep([pose(1.0), pose(2.0)])
            assert "connection" in store.keeper.database_problem
            assert "\n" not in store.keeper.database_problem
            assert store.keeper.counts.acknowledged == 3
            assert len(store.spool) == 1
        finally:
            server.start()
        store.keep([pose(3.0)])
        assert store.keeper.database_problem == ""
        assert store.count() == 4
