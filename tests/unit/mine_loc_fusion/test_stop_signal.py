"""The stop signal: whatever happens on the way, a machine runs only on a permission that is fresh and alive."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.stamps import NS_PER_S, to_ns
from mine_loc_fusion.stop_signal import StopOrder, StopReceiver, StopSender

VALID_S = 0.5


def run_order(heartbeat: int, *, stop: bool = False) -> StopOrder:
    return StopOrder(stop, heartbeat, VALID_S, "somebody is near" if stop else "")


@pytest.fixture
def receiver() -> StopReceiver:
    """That was permitted to run at 0."""
    made = StopReceiver()
    made.take(run_order(1), 0, 0)
    made.take(run_order(2), 0, 0)
    assert made.why_stop(0) == ""
    return made


def test_reasons_make_a_stop_and_each_message_counts_one_up():
    sender = StopSender(VALID_S)
    assert sender.order(["a", "b"]) == StopOrder(True, 1, VALID_S, "a; b")
    assert sender.order([]) == StopOrder(False, 2, VALID_S, "")


def test_a_machine_that_has_heard_nothing_stands():
    assert StopReceiver().why_stop(0) == "no stop signal heard yet"


def test_one_message_is_no_beat_two_are():
    receiver = StopReceiver()
    receiver.take(run_order(7), 0, 0)
    assert receiver.why_stop(0) == "heartbeat does not go on"
    receiver.take(run_order(8), 0, 0)
    assert receiver.why_stop(0) == ""


def test_an_order_to_stop_counts_at_once_whatever_its_number_or_age(receiver):
    receiver.take(run_order(1, stop=True), 99 * NS_PER_S, 1)
    assert receiver.why_stop(1) == "somebody is near"


def test_silence_stops_it(receiver):
    assert receiver.why_stop(to_ns(0.5)) == ""
    assert receiver.why_stop(to_ns(0.5) + 1) == "stop signal is silent"


@pytest.mark.parametrize("heartbeat", [2, 1, 13])
def test_a_heart_that_does_not_go_on_stops_it(receiver, heartbeat):
    receiver.take(run_order(heartbeat), 0, 1)
    assert receiver.why_stop(1) == "heartbeat does not go on"
    receiver.take(run_order(heartbeat + 1), 0, 2)
    assert receiver.why_stop(2) == ""


def test_lost_messages_and_the_end_of_the_counter_are_no_reason(receiver):
    receiver.take(run_order(12), 0, 1)
    assert receiver.why_stop(1) == ""
    wrapping = StopReceiver()
    for heartbeat in (2**32 - 1, 0):
        wrapping.take(run_order(heartbeat), 0, 0)
    assert wrapping.why_stop(0) == ""


@pytest.mark.parametrize("age_s", [0.6, -0.6, 3600.0])
def test_an_old_permission_and_one_from_the_future_count_nothing(receiver, age_s):
    receiver.take(run_order(3), to_ns(age_s), 1)
    assert receiver.why_stop(1) == f"stop signal came {age_s:.1f} s old"


def test_what_a_permission_took_to_arrive_is_taken_off_its_time(receiver):
    receiver.take(run_order(3), to_ns(0.3), 0)
    assert receiver.why_stop(to_ns(0.2)) == ""
    assert receiver.why_stop(to_ns(0.2) + 1) == "stop signal is silent"


@pytest.mark.parametrize("valid_s", [0.0, -1.0, 5.1, math.inf, math.nan])
def test_a_permission_for_no_time_or_for_ever_is_none(receiver, valid_s):
    receiver.take(StopOrder(False, 3, valid_s, ""), 0, 1)
    assert receiver.why_stop(1) == "told to stop"


def test_after_the_clock_was_set_the_next_message_decides(receiver):
    receiver.forget()
    assert receiver.why_stop(0) == "clock was set"
    receiver.take(run_order(3), 0, 1)
    assert receiver.why_stop(1) == ""


events = st.lists(
    st.tuples(
        st.integers(0, 700),  # ms until it arrives
        st.integers(-2, 12),  # how far the heartbeat goes on
        st.booleans(),
        st.integers(-100, 800),  # ms old
    ),
    max_size=30,
)


@given(events, st.integers(0, 700))
def test_fail_safe_it_runs_only_on_the_last_message_s_permission_while_that_is_valid(course, wait_ms):
    receiver, heartbeat, at_ms = StopReceiver(), 1000, 0
    for delay_ms, step, stop, age_ms in course:
        at_ms, heartbeat = at_ms + delay_ms, heartbeat + step
        receiver.take(run_order(heartbeat, stop=stop), age_ms * 10**6, at_ms * 10**6)
    if receiver.why_stop((at_ms + wait_ms) * 10**6) == "":
        assert len(course) >= 2
        _, step, stop, age_ms = course[-1]
        assert not stop
        assert 1 <= step <= 10
        assert wait_ms + max(age_ms, 0) <= 500
