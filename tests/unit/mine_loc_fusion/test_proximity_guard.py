"""Whether a vehicle may run: what is known lets it, what is not known does not, each with its reason."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.stamps import NS_PER_S, to_ns
from mine_loc_fusion.mode import Mode
from mine_loc_fusion.possible_presence import KNOWN_MODES, DoubtRule, SeenPerson
from mine_loc_fusion.presence import PresenceRule
from mine_loc_fusion.proximity import Pose2, ProximityRules, ProximityZone
from mine_loc_fusion.proximity_guard import MOST_PEOPLE, GuardRules, ProximityGuard
from mine_loc_fusion.zone_shape import outline

PRESENCE = PresenceRule(0.5, 0.1, 0.0, 0.0)
RULES = GuardRules(ProximityRules(PRESENCE, PRESENCE), DoubtRule(0.5, 5.0, 3.0), 0.5, 3.0, 0.5)
CAR = ProximityZone("round_car", outline(6.0, 2.0), "car", 5.0, 2.0)
NOW = 1000 * NS_PER_S
FAR, NEAR = 50.0, 4.0  # m before the car's middle


def seen(x_m=FAR, *, at_ns=NOW, sd_m=0.1, mode=Mode.UWB_PDR, person="fitter") -> SeenPerson:
    return SeenPerson(person, at_ns, np.array([x_m, 0.0]), sd_m**2 * np.eye(2), mode)


@pytest.fixture
def guard() -> ProximityGuard:
    """Of a car that stands, with a person far away, all heard at NOW on both clocks."""
    made = ProximityGuard((CAR,), {"car": Pose2(0.0, 0.0, 0.0)}, RULES)
    made.take_people([seen()], NOW)
    return made


def reasons(guard: ProximityGuard, after_s: float = 0.0) -> tuple[str, ...]:
    now_ns = NOW + to_ns(after_s)
    return guard.stop_reasons("car", now_ns, now_ns)


def test_a_vehicle_runs_while_all_are_known_to_be_elsewhere(guard):
    assert reasons(guard) == ()
    assert reasons(guard, 0.5) == ()


def test_at_the_start_nothing_is_known_so_it_stands():
    assert reasons(ProximityGuard((CAR,), {"car": Pose2(0.0, 0.0, 0.0)}, RULES)) == ("no poses heard yet",)


def test_silence_of_the_poses_stops_it(guard):
    assert reasons(guard, 0.51) == ("no poses for 0.5 s",)
    guard.take_sign_of_life(NOW + to_ns(0.5))  # of no use once somebody was positioned
    assert reasons(guard, 0.6) == ("no poses for 0.6 s",)


def test_while_nobody_is_positioned_the_fusion_need_only_live():
    guard = ProximityGuard((CAR,), {"car": Pose2(0.0, 0.0, 0.0)}, RULES)
    guard.take_sign_of_life(NOW)
    assert reasons(guard, 2.9) == ()
    assert reasons(guard, 3.1) == ("no poses for 3.1 s",)


def test_somebody_in_danger_stops_it_until_acknowledged(guard):
    assert guard.take_people([seen(NEAR)], NOW)
    assert reasons(guard) == ("fitter in danger zone round_car",)
    guard.take_people([seen(FAR)], NOW)
    assert reasons(guard) == ("fitter was in danger zone round_car: not acknowledged",)
    guard.proximity.acknowledge()
    assert reasons(guard) == ()


@pytest.mark.parametrize("mode", sorted(set(Mode) - KNOWN_MODES))
def test_somebody_lost_stops_it_where_they_may_be_near(guard, mode):
    guard.take_people([seen(20.0, sd_m=10.0, mode=mode)], NOW)
    assert reasons(guard) == (f"fitter may be in danger zone round_car: mode {mode.name}",)
    guard.take_people([seen(90.0, sd_m=10.0, mode=mode)], NOW)
    assert reasons(guard) == ()


def test_a_circle_too_wide_to_say_where_somebody_is_stops_it_if_it_reaches_the_zone(guard):
    guard.take_people([seen(20.0, sd_m=8.0, mode=Mode.COASTING)], NOW)  # 95 % within 19.6 m; the zone begins at 15 m
    assert reasons(guard) == ("fitter may be in danger zone round_car: 95 % circle of 19.6 m",)
    guard.take_people([seen(40.0, sd_m=8.0, mode=Mode.COASTING)], NOW)
    assert reasons(guard) == ()


def test_a_stale_pose_grows_until_it_reaches_the_zone_though_others_are_heard(guard):
    def after(seconds: float) -> tuple[str, ...]:
        now_ns = NOW + to_ns(seconds)
        guard.take_people([seen(FAR, at_ns=now_ns, person="other")], now_ns)
        return guard.stop_reasons("car", now_ns, now_ns)

    assert after(14.0) == ()  # 42 m walked of 45 m
    assert after(15.0) == ("fitter may be in danger zone round_car: position is 15.0 s old",)


@pytest.mark.parametrize(
    "broken",
    [
        SeenPerson("fitter", NOW, np.array([math.nan, 0.0]), np.eye(2), Mode.UWB_PDR),
        SeenPerson("fitter", NOW, np.array([FAR, 0.0]), np.full((2, 2), math.inf), Mode.UWB_PDR),
        SeenPerson("fitter", NOW, np.array([FAR, 0.0]), np.zeros((2, 2)), Mode.UWB_PDR),
        SeenPerson("fitter", NOW, np.array([FAR, 0.0]), -np.eye(2), Mode.UWB_PDR),
    ],
)
def test_a_pose_that_says_nothing_stops_it(guard, broken):
    assert not guard.take_people([broken], NOW)
    assert reasons(guard) == ("fitter may be in danger zone round_car: no position with a covariance",)


def test_doubt_ends_no_alarm(guard):
    guard.take_people([seen(NEAR)], NOW)
    guard.take_people([seen(500.0, mode=Mode.LOST)], NOW)
    assert reasons(guard) == ("fitter in danger zone round_car",)


def test_whoever_is_in_doubt_can_be_vouched_for_until_positioned_again(guard):
    assert guard.vouch("fitter", NOW) == ()  # well positioned
    guard.take_people([seen(NEAR)], NOW)
    lost = [seen(NEAR, mode=Mode.LOST)]
    guard.take_people(lost, NOW)
    assert len(reasons(guard)) == 2
    assert guard.vouch("", NOW) == ("fitter",)
    guard.take_people(lost, NOW)
    assert reasons(guard) == ()
    guard.take_people([seen(NEAR)], NOW)
    assert reasons(guard) == ("fitter in danger zone round_car",)


def test_a_vehicle_that_moves_must_say_where_it_is():
    guard = ProximityGuard((CAR,), {}, RULES)
    guard.take_people([seen()], NOW)
    assert reasons(guard) == ("no pose of the vehicle heard yet",)
    guard.take_vehicle("car", NOW, Pose2(0.0, 0.0, 0.0))
    assert reasons(guard, 0.5) == ()
    guard.take_people([seen(at_ns=NOW + to_ns(0.6))], NOW + to_ns(0.6))
    assert reasons(guard, 0.6) == ("pose of the vehicle is 0.6 s old",)


def test_people_who_left_the_site_s_file_are_forgotten_with_their_alarms(guard):
    guard.take_people([seen(NEAR), seen(NEAR, person="other")], NOW)
    guard.forget_people(["fitter"])
    assert reasons(guard) == ("other in danger zone round_car",)


@pytest.mark.parametrize("delta_s", [-3600.0, 3600.0])
def test_a_jump_of_the_clock_changes_no_age(guard, delta_s):
    delta_ns = to_ns(delta_s)
    assert guard.stop_reasons("car", NOW + delta_ns, NOW) != ()
    guard.time_jumped(delta_ns)
    assert guard.stop_reasons("car", NOW + delta_ns, NOW) == ()


def test_more_people_than_can_be_kept_stop_it_for_good(guard):
    guard.take_people([seen(person=f"p{number}") for number in range(MOST_PEOPLE)], NOW)
    assert reasons(guard) == (f"more than {MOST_PEOPLE} people",)


@given(
    x_m=st.floats(-60.0, 60.0),
    sd_m=st.floats(0.05, 30.0),
    mode=st.sampled_from(Mode),
    age_s=st.floats(0.0, 30.0),
    heard_s=st.floats(0.0, 3.0),
    vehicle_s=st.floats(0.0, 3.0),
)
def test_fail_safe_it_runs_only_if_all_is_fresh_and_nobody_can_be_in_danger(x_m, sd_m, mode, age_s, heard_s, vehicle_s):
    guard = ProximityGuard((CAR,), {}, RULES)
    guard.take_vehicle("car", NOW - to_ns(vehicle_s), Pose2(0.0, 0.0, 0.0))
    guard.take_people([seen(x_m, at_ns=NOW - to_ns(age_s), sd_m=sd_m, mode=mode)], NOW - to_ns(heard_s))
    if guard.stop_reasons("car", NOW, NOW) == ():
        assert heard_s <= 0.5
        assert vehicle_s <= 0.5
        assert abs(x_m) > 5.0
        circle_m = 2.4477 * sd_m  # 95 % of a circular distribution
        if mode not in KNOWN_MODES or age_s > 0.5 or circle_m > 5.0:
            assert abs(x_m) - 5.0 > circle_m + 3.0 * age_s - 1e-3
