"""Alarms of people in zones: levels, events, latching and acknowledging."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.stamps import NS_PER_S
from mine_loc_fusion.presence import PresenceRule
from mine_loc_fusion.proximity import AlarmEvent, AlarmLevel, Pose2, Proximity, ProximityRules, ProximityZone
from mine_loc_fusion.zone_shape import outline

ENTER, LEAVE, STAY = AlarmEvent.ENTER, AlarmEvent.LEAVE, AlarmEvent.STAY
CLEAR, WARNING, DANGER = AlarmLevel.CLEAR, AlarmLevel.WARNING, AlarmLevel.DANGER
RULE = PresenceRule(0.5, 0.1, 0.0, 0.0)
CAR = ProximityZone("round_car", outline(6.0, 2.0), "car", 5.0, 2.0)
AT_ORIGIN = {"car": Pose2(0.0, 0.0, 0.0)}
SURE = 0.01 * np.eye(2)


@pytest.fixture
def proximity() -> Proximity:
    return Proximity((CAR,), ProximityRules(RULE, RULE))


def walk(proximity, *x_m, person="fitter", vehicles=AT_ORIGIN):
    """Update along the x axis, one position a second, publishing after each; what was said (level, event, latched)."""
    told = []
    for number, x in enumerate(x_m):
        proximity.update(person, number * NS_PER_S, np.array([x, 0.0]), SURE, vehicles)
        told.append([(alarm.level, alarm.event, alarm.latched) for alarm in proximity.alarms()])
        proximity.published()
    return told


def test_a_person_who_passes_is_told_of_once_a_change_and_stays_latched_after_danger(proximity):
    assert walk(proximity, 12.0, 7.0, 6.0, 4.0, 4.0, 7.0, 7.0, 12.0, 13.0) == [
        [],
        [(WARNING, ENTER, False)],
        [(WARNING, STAY, False)],
        [(DANGER, ENTER, True)],
        [(DANGER, STAY, True)],
        [(WARNING, LEAVE, True)],
        [(WARNING, STAY, True)],
        [(CLEAR, LEAVE, True)],
        [(CLEAR, LEAVE, True)],
    ]


def test_a_warning_alone_is_not_latched_and_vanishes_when_its_end_is_told(proximity):
    assert walk(proximity, 7.0, 12.0, 12.0) == [[(WARNING, ENTER, False)], [(CLEAR, LEAVE, False)], []]


def test_the_alarm_says_how_probable_how_far_and_since_when(proximity):
    walk(proximity, 12.0, 7.0, 6.5)
    (alarm,) = proximity.alarms()
    assert (alarm.zone_id, alarm.person, alarm.since_ns) == ("round_car", "fitter", NS_PER_S)
    assert alarm.distance_m == pytest.approx(3.5)
    assert alarm.probability == 1.0


def test_the_covariance_counts_and_not_the_mean_alone():
    """4 m off the danger zone: out of it when sure, possibly in it when not."""
    rules = ProximityRules(RULE, PresenceRule(0.05, 0.02, 0.0, 0.0))
    for sd_m, level in ((0.1, CLEAR), (4.0, DANGER)):
        unsure = Proximity((ProximityZone("z", outline(6.0, 2.0), None, None, 2.0),), rules)
        unsure.update("fitter", 0, np.array([9.0, 0.0]), sd_m**2 * np.eye(2), {})
        assert max((alarm.level for alarm in unsure.alarms()), default=CLEAR) == level


def test_a_carried_zone_goes_and_turns_with_its_vehicle(proximity):
    beside = np.array([100.0, 4.5])
    for yaw, inside in ((0.0, False), (np.pi / 2, True)):  # 3.5 m off the side, 1.5 m off the front
        proximity.forget(["fitter"])
        proximity.update("fitter", 0, beside, SURE, {"car": Pose2(100.0, 0.0, yaw)})
        assert bool(proximity.endangered("car")) == inside


def test_a_zone_whose_vehicle_is_nowhere_ends_no_alarm(proximity):
    walk(proximity, 4.0)
    assert not proximity.update("fitter", 9 * NS_PER_S, np.array([50.0, 0.0]), SURE, {})
    assert proximity.alarms()[0].level is DANGER


def test_a_danger_can_be_acknowledged_only_when_it_is_over(proximity):
    walk(proximity, 4.0)
    released, kept = proximity.acknowledge()
    assert (released, [alarm.person for alarm in kept]) == ((), ["fitter"])
    assert proximity.endangered("car")
    walk(proximity, 4.0, 12.0)
    assert proximity.endangered("car")
    assert proximity.acknowledge("nobody") == ((), ())
    assert proximity.endangered("car")
    released, kept = proximity.acknowledge("fitter")
    assert ([alarm.person for alarm in released], kept) == (["fitter"], ())
    assert not proximity.endangered("car")
    proximity.published()
    assert proximity.alarms() == ()
    assert proximity.acknowledge("fitter") == ((), ())  # twice is well


def test_only_the_vehicle_that_carries_the_zone_stands():
    there = ProximityZone("fall", outline(4.0, 4.0), None, None, 0.0)
    proximity = Proximity((CAR, there), ProximityRules(RULE, RULE))
    proximity.update("fitter", 0, np.array([0.0, 0.0]), SURE, {"car": Pose2(100.0, 0.0, 0.0)})
    assert [alarm.zone_id for alarm in proximity.alarms()] == ["fall"]
    assert proximity.endangered("car") == ()


def test_the_worst_comes_first_because_what_does_not_fit_is_left_out(proximity):
    for person, x in (("far", 7.0), ("near", 4.0), ("further", 7.5)):
        walk(proximity, x, person=person)
    assert next(alarm.person for alarm in proximity.alarms()) == "near"


@given(st.lists(st.tuples(st.sampled_from([0.0, 4.0, 7.0, 12.0]), st.sampled_from(["move", "ack"])), max_size=30))
def test_whatever_happens_the_vehicle_stands_from_a_danger_to_an_acknowledgement_after_it(course):
    proximity = Proximity((CAR,), ProximityRules(RULE, RULE))
    must_stand = in_danger = False
    for number, (x, what) in enumerate(course):
        if what == "move":
            proximity.update("fitter", number * NS_PER_S, np.array([x, 0.0]), SURE, AT_ORIGIN)
            in_danger = x < 5.0
            must_stand |= in_danger
        else:
            proximity.acknowledge()
            must_stand &= in_danger
        proximity.published()
        assert bool(proximity.endangered("car")) == must_stand
