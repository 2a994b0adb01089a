from hypothesis import given
from hypothesis import strategies as st

from mine_loc_coarse.monitor_clock import MonitorClock
from mine_loc_core.stamps import NS_PER_S

OFFSET_NS = 1_700_000_000 * NS_PER_S


@given(st.lists(st.floats(0.0, 5.0), min_size=1, max_size=50))
def test_the_quickest_report_gives_the_offset_and_no_stamp_lies_after_its_arrival(delays_s):
    clock = MonitorClock()
    for number, delay_s in enumerate(delays_s):
        monitor_ns = number * NS_PER_S
        arrival_ns = OFFSET_NS + monitor_ns + round(delay_s * NS_PER_S)
        stamp_ns = clock.stamp(monitor_ns, arrival_ns)
        assert stamp_ns <= arrival_ns
    assert stamp_ns - OFFSET_NS - monitor_ns == min(round(delay * NS_PER_S) for delay in delays_s)
    assert clock.resets == 0


def test_a_clock_that_is_set_anew_is_mapped_anew_and_counted():
    clock = MonitorClock()
    clock.stamp(0, OFFSET_NS)
    assert clock.stamp(500 * NS_PER_S, OFFSET_NS + NS_PER_S) == OFFSET_NS + NS_PER_S
    assert clock.resets == 1
