"""Fused poses become alarms and a stop signal: entering, leaving, acknowledging, and stopping when nothing is known."""

import itertools
from collections.abc import Iterator

import pytest
from graph.observer import Observer
from graph.processes import Running, node_command, running
from graph.shuttle_site import ENDANGERED_M, FAR_M, WARNED_M, Surroundings, write_shuttle_site
from mine_loc_interfaces.msg import PersonPose, ProximityAlarm, ProximityAlarmArray
from mine_loc_interfaces.srv import Reset

from mine_loc_core.nodes.qos import LATCHED

pytestmark = pytest.mark.graph

IN_DANGER = "fitter in danger zone round_car"
NOT_ACKNOWLEDGED = "fitter was in danger zone round_car: not acknowledged"


@pytest.fixture
def node(domain, tmp_path, request) -> Iterator[Running]:
    site = write_shuttle_site(tmp_path / "site", stands=getattr(request, "param", True))
    command = node_command("mine_loc_fusion.nodes.proximity", {"site": site})
    with running(command, domain, tmp_path / "log") as run:
        yield run
        assert "Traceback" not in run.output


@pytest.fixture
def around(node, observer) -> Surroundings:
    assert node.alive
    return Surroundings(observer)


def acknowledge(observer: Observer) -> Reset.Response:
    return observer.call(Reset, "/proximity/acknowledge", Reset.Request())


def level(around: Surroundings) -> int | None:
    return around.alarm.level if around.alarm else None


def test_an_approach_warns_then_stops_and_holds_until_acknowledged(around, observer):
    around.wait_until_told("")
    around.move(WARNED_M)
    around.wait_for(lambda: level(around) == ProximityAlarm.WARNING)
    assert around.reason == ""
    around.move(ENDANGERED_M)
    around.wait_until_told(IN_DANGER)
    around.wait_for(lambda: level(around) == ProximityAlarm.DANGER)
    assert around.alarm.latched
    assert around.alarm.distance == pytest.approx(1.0, abs=0.01)
    assert around.alarm.probability > 0.9
    refused = acknowledge(observer)
    assert (refused.success, refused.reason) == (False, "still in danger: fitter in round_car")

    around.move(FAR_M)
    around.wait_until_told(NOT_ACKNOWLEDGED)
    told = [(alarm.level, alarm.event) for message in around.alarms.messages for alarm in message.alarms]
    changes = [each for each, _ in itertools.groupby(told) if each[1] != ProximityAlarm.STAY]
    assert changes == [
        (ProximityAlarm.WARNING, ProximityAlarm.ENTER),
        (ProximityAlarm.DANGER, ProximityAlarm.ENTER),
        (ProximityAlarm.CLEAR, ProximityAlarm.LEAVE),
    ]
    answer = acknowledge(observer)
    assert (answer.success, answer.reason) == (True, "acknowledged fitter in round_car")
    around.wait_until_told("")
    around.wait_for(lambda: around.alarm is None)
    assert acknowledge(observer).reason == "nothing was latched"


def test_whoever_comes_late_is_told_the_alarms_of_the_moment(around, observer):
    around.move(ENDANGERED_M)
    around.wait_until_told(IN_DANGER)
    late = observer.listen(ProximityAlarmArray, "proximity/alarms", LATCHED)
    around.wait_for(lambda: len(late), 0.9, "the alarms at once, before they are told again")
    assert [alarm.person for alarm in late.messages[0].alarms] == ["fitter"]


def test_the_heartbeat_goes_on_by_one_and_says_how_long_it_is_good_for(around):
    around.wait_until_told("")
    around.stops.messages.clear()
    around.wait_for(lambda: len(around.stops.messages) > 30)
    beats = [message.heartbeat for message in around.stops.messages]
    assert beats == list(range(beats[0], beats[0] + len(beats)))
    assert {message.vehicle for message in around.stops.messages} == {"car"}
    assert {message.valid_for for message in around.stops.messages} == {0.5}


def test_silence_of_the_poses_stops_the_vehicle_and_their_return_releases_it(around):
    around.wait_for(lambda: around.reason is not None)
    around.wait_until_told("")
    around.silent = True
    assert around.wait_for(lambda: around.reason.startswith("no poses for"), 2.0) < 1.0
    around.silent = False
    around.wait_until_told("", 2.0)


def test_somebody_lost_nearby_stops_it_until_somebody_vouches(around, observer):
    around.wait_until_told("")
    around.move(FAR_M, person="miner")
    around.move(ENDANGERED_M, PersonPose.LOST)
    around.wait_until_told("fitter may be in danger zone round_car: mode LOST")
    refused = observer.call(Reset, "/proximity/vouch", Reset.Request(person="miner"))
    assert (refused.success, refused.reason) == (False, "'miner' is well positioned, or was never heard of")
    answer = observer.call(Reset, "/proximity/vouch", Reset.Request(person="fitter"))
    assert answer.success
    assert answer.reason.endswith("not watched: fitter")
    around.wait_until_told("")
    around.move(ENDANGERED_M)
    around.wait_until_told(IN_DANGER)


@pytest.mark.parametrize("node", [False], indirect=True, ids=["moves"])
def test_a_vehicle_that_moves_carries_its_zone_and_stands_when_it_is_silent(around):
    around.wait_until_told("no pose of the vehicle heard yet")
    around.car_at_m = 0.0
    around.wait_until_told("")
    around.car_at_m = FAR_M - 4.0
    around.wait_until_told(IN_DANGER)
    around.car_at_m = None
    around.wait_for(lambda: around.reason.startswith("pose of the vehicle is"), 2.0)
