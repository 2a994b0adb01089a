"""The store as a node: every topic it hears ends in its table, and trouble is said in one line."""

import sqlite3
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from graph.observer import Observer
from graph.processes import node_command, running
from mine_loc_interfaces.msg import (
    CoarseRegion,
    CoarseRegionArray,
    PersonPose,
    PersonPoseArray,
    ProximityAlarm,
    ProximityAlarmArray,
    UwbRange,
    UwbRangeArray,
)

from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.qos import EVENTS, LATCHED

pytestmark = pytest.mark.graph

SITE = Path(__file__).parents[2] / "config" / "example_mine"
DATABASE = "store: database"
TOPICS = {
    "fused/poses": (PersonPoseArray, EVENTS),
    "coarse/regions": (CoarseRegionArray, EVENTS),
    "proximity/alarms": (ProximityAlarmArray, LATCHED),
    "uwb/ranges": (UwbRangeArray, EVENTS),
}


def command(folder: Path) -> list[str]:
    database = f"sqlite:///{folder / 'store.db'}"
    return node_command("mine_loc_bringup.nodes.store", {"site": SITE, "database": database, "spool_mb": 1})


def publishers(observer: Observer) -> Callable[..., None]:
    made = {topic: observer.node.create_publisher(kind, topic, qos) for topic, (kind, qos) in TOPICS.items()}
    observer.wait_for(lambda: all(each.get_subscription_count() for each in made.values()), what="subscriptions")

    def publish(topic: str, frame: str = "map", **fields: object) -> None:
        message = TOPICS[topic][0](**fields)
        message.header.stamp, message.header.frame_id = to_time(time.time_ns()), frame
        made[topic].publish(message)

    return publish


def fitter(x_m: float) -> list[PersonPose]:
    pose = PersonPose(person="fitter", mode=PersonPose.UWB_PDR, stamp=to_time(time.time_ns()), horizontal_ce95=0.5)
    pose.pose.pose.position.x = x_m
    return [pose]


def asked(folder: Path, query: str) -> list[tuple[object, ...]]:
    with closing(sqlite3.connect(folder / "store.db")) as database:
        return database.execute(query).fetchall()


def test_what_is_heard_is_stored(tmp_path, domain, observer):
    with running(command(tmp_path), domain, tmp_path / "log") as store:
        publish = publishers(observer)
        publish("fused/poses", people=fitter(3.0))
        publish("fused/poses", people=fitter(20.0))
        publish("fused/poses", frame="elsewhere", people=fitter(1.0))
        region = CoarseRegion(region_id=7, radius=2.0, galleries=["main"], status=CoarseRegion.NEW)
        publish("coarse/regions", regions=[region])
        alarm = ProximityAlarm(zone_id="round_car", person="fitter", level=ProximityAlarm.DANGER, latched=True)
        for _ in range(3):
            publish("proximity/alarms", alarms=[alarm])
        ranges = [UwbRange(anchor_id=n, range=float(n), los_probability=n / 4) for n in (1, 2)]
        publish("uwb/ranges", tag_id=2**64 - 1, ranges=[*ranges, UwbRange(los_probability=float("nan"), range=9.0)])
        # two poses, entering portal and main, leaving portal, a region, an alarm, a round
        observer.wait_for(lambda: observer.value(DATABASE, "acknowledged") == 8, what="eight rows")
        assert observer.value(DATABASE, "refused_frame") == 1
        store.stop()
        assert store.ends() == 0
        assert "Traceback" not in store.output
    assert asked(tmp_path, "SELECT name FROM poses JOIN places ON id = place_id ORDER BY stamp_ns") == [
        ("main portal",), ("main",),
    ]  # fmt: skip
    events = asked(tmp_path, "SELECT name, event FROM zone_events JOIN areas ON id = area_id ORDER BY stamp_ns, name")
    assert events == [("main", "enter"), ("portal", "enter"), ("portal", "leave")]
    assert asked(tmp_path, "SELECT region_id, radius_m, galleries FROM regions") == [(7, 2.0, "main")]
    assert asked(tmp_path, "SELECT zone, level, latched FROM alarms") == [("round_car", 3, 1)]
    assert asked(tmp_path, "SELECT tag_id, ranges, los_fraction, longest_m FROM range_rounds") == [(-1, 3, 0.375, 9.0)]


def test_rows_that_wait_at_the_end_are_written_before_it(tmp_path, domain, observer):
    with running(command(tmp_path), domain, tmp_path / "log") as store:
        publish = publishers(observer)
        observer.wait_for(lambda: DATABASE in observer.status)
        for n in range(20):
            publish("fused/poses", people=fitter(20.0 + n))
        observer.wait_for(lambda: observer.value(DATABASE, "acknowledged") + observer.value(DATABASE, "waiting") > 0)
        store.stop()
    assert asked(tmp_path, "SELECT count(*) FROM poses") == [(20,)]


def test_a_locked_database_is_one_line_and_nothing_is_lost(tmp_path, domain, observer):
    with running(command(tmp_path), domain, tmp_path / "log") as store:
        publish = publishers(observer)
        publish("fused/poses", people=fitter(20.0))
        observer.wait_for(lambda: observer.value(DATABASE, "acknowledged") == 2, what="a pose and its event")
        with closing(sqlite3.connect(tmp_path / "store.db", isolation_level=None)) as other:
            other.execute("BEGIN IMMEDIATE")
            for n in range(5):
                publish("fused/poses", people=fitter(21.0 + n))
            observer.wait_for(lambda: observer.value(DATABASE, "acknowledged") == 7, what="rows in the spool")
            observer.wait_for(lambda: observer.level(DATABASE) == 1, what="a warning")
            assert "database is locked; rows wait in " in observer.status[DATABASE].message
        observer.wait_for(lambda: observer.level(DATABASE) == 0, what="the end of the warning")
        assert observer.value(DATABASE, "spooled_batches") == observer.value(DATABASE, "lost") == 0
        said = [line for line in store.output.splitlines() if "sqlite:///" in line]
        assert ["database is locked" in line for line in said] == [True, False]
        assert "takes rows again" in said[1]
    assert asked(tmp_path, "SELECT count(*) FROM poses") == [(6,)]


def test_a_database_that_is_not_there_is_waited_for(tmp_path, domain, observer):
    parameters = {"site": SITE, "database": "postgresql://127.0.0.1:1/x", "spool": tmp_path / "spool", "spool_mb": 1}
    with running(node_command("mine_loc_bringup.nodes.store", parameters), domain, tmp_path / "log"):
        publish = publishers(observer)
        publish("fused/poses", people=fitter(20.0))
        observer.wait_for(lambda: observer.value(DATABASE, "acknowledged") == 2, what="rows in the spool")
        assert observer.level(DATABASE) == 1
        assert "postgresql://127.0.0.1:1/x: " in observer.status[DATABASE].message


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({"database": "mysql://host/x"}, "database: mysql://host/x: not supported; allowed: sqlite:///FILE or"),
        ({"full_rate_days": 400.0}, "full_rate_days <= second_days <= keep_days"),
        ({"spool": "/dev/null/spool"}, "spool: /dev/null/spool: "),
    ],
)
def test_what_is_impossible_is_one_line_and_exit_status_2(parameters, said, tmp_path, domain):
    given = {"site": SITE, "database": f"sqlite:///{tmp_path / 'store.db'}"} | parameters
    with running(node_command("mine_loc_bringup.nodes.store", given), domain, tmp_path / "log") as store:
        assert store.ends() == 2
        assert [said in line for line in store.output.splitlines()] == [True]
