"""What no solver is shown: impossible values, stuck ones, instants that do not rise."""

import math

import pytest

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_core.verdicts import Reason
from mine_loc_uwb.range_checks import RepeatedValues, impossible, stamp_reason


@pytest.mark.parametrize("value_m", [math.nan, math.inf, -math.inf, 0.0, -0.1, -45.0, 300.1, 1e308])
def test_what_no_radio_can_measure_is_impossible(value_m):
    assert impossible(value_m, 300.0, difference=False)


@pytest.mark.parametrize("value_m", [0.001, 12.0, 300.0])
def test_a_range_up_to_the_longest_is_possible(value_m):
    assert not impossible(value_m, 300.0, difference=False)


@pytest.mark.parametrize("value_m", [0.0, -12.0, -300.0, 12.0])
def test_a_difference_may_be_negative_or_nothing(value_m):
    assert not impossible(value_m, 300.0, difference=True)


@pytest.mark.parametrize("value_m", [math.nan, -math.inf, -300.1, 300.1])
def test_a_difference_is_no_longer_than_the_longest_range_either_way(value_m):
    assert impossible(value_m, 300.0, difference=True)


def test_a_link_that_says_the_same_twenty_times_more_is_frozen_until_it_says_something_else():
    values = RepeatedValues()
    assert [values.frozen(1, 5.0) for _ in range(22)] == [False] * 20 + [True] * 2
    assert not values.frozen(1, 5.001)
    assert not values.frozen(1, 5.0)


def test_links_freeze_apart():
    values = RepeatedValues()
    for _ in range(30):
        values.frozen(1, 5.0)
    assert not values.frozen(2, 5.0)
    assert values.frozen(1, 5.0)


NOW_NS = 1_000 * NS_PER_S


@pytest.mark.parametrize(
    ("stamp_ns", "last_ns", "reason"),
    [
        (NOW_NS, None, Reason.ACCEPTED),
        (NOW_NS, NOW_NS - 1, Reason.ACCEPTED),
        (NOW_NS + 50 * NS_PER_MS, None, Reason.ACCEPTED),
        (NOW_NS + 50 * NS_PER_MS + 1, None, Reason.FUTURE),
        (NOW_NS + 10 * NS_PER_S, NOW_NS, Reason.FUTURE),
        (NOW_NS, NOW_NS, Reason.DUPLICATE),
        (NOW_NS - 1, NOW_NS, Reason.BACKWARD),
        (0, NOW_NS, Reason.BACKWARD),
    ],
)
def test_instants_rise_and_none_has_yet_to_come(stamp_ns, last_ns, reason):
    assert stamp_reason(stamp_ns, last_ns, NOW_NS) is reason
