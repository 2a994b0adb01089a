"""Bag time: at a rate, paused, held back, set back."""

from hypothesis import given
from hypothesis import strategies as st

from mine_loc_bringup.bags.timeline import Timeline

MS = 1_000_000


def test_bag_time_passes_at_the_rate_and_waits_are_steady_time():
    line = Timeline(bag_ns=1000 * MS, steady_ns=50 * MS, rate=4.0)
    assert line.bag_ns(50 * MS) == 1000 * MS
    assert line.bag_ns(60 * MS) == 1040 * MS
    assert line.wait_ns(1080 * MS, 60 * MS) == 10 * MS
    assert line.wait_ns(1030 * MS, 60 * MS) == 0


def test_a_pause_stands_still_and_nothing_is_skipped_by_it():
    line = Timeline(0, 0, 1.0)
    line.pause(10 * MS, paused=True)
    assert line.bag_ns(500 * MS) == 10 * MS
    assert line.wait_ns(11 * MS, 500 * MS) is None
    line.pause(500 * MS, paused=False)
    assert line.bag_ns(505 * MS) == 15 * MS


def test_a_new_rate_holds_from_now_on():
    line = Timeline(0, 0, 1.0)
    line.set_rate(10.0, 100 * MS)
    assert line.bag_ns(101 * MS) == 110 * MS


def test_time_is_held_back_for_who_is_late_by_more_than_a_little():
    line = Timeline(0, 0, 2.0)
    line.hold(100 * MS, most_behind_ns=20 * MS, steady_ns=60 * MS)  # bag time 120 ms: late by 10 ms
    assert line.bag_ns(60 * MS) == 120 * MS
    line.hold(100 * MS, most_behind_ns=20 * MS, steady_ns=90 * MS)  # bag time 180 ms: late by 40 ms
    assert line.bag_ns(90 * MS) == 140 * MS


@given(
    st.lists(st.tuples(st.integers(0, 10**9), st.sampled_from(["pause", "go", "rate", "look"]), st.floats(0.01, 100)))
)
def test_bag_time_never_goes_back_by_itself(steps):
    line = Timeline(0, 0, 1.0)
    steady_ns = bag_ns = 0
    for wait_ns, what, rate in steps:
        steady_ns += wait_ns
        if what == "rate":
            line.set_rate(rate, steady_ns)
        elif what != "look":
            line.pause(steady_ns, paused=what == "pause")
        assert line.bag_ns(steady_ns) >= bag_ns
        bag_ns = line.bag_ns(steady_ns)
