"""Integer nanoseconds and the borders where seconds appear."""

from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.stamps import NS_PER_S, to_ns, to_s

DAY_NS = 86_400 * NS_PER_S


@given(st.integers(-48 * DAY_NS, 48 * DAY_NS))
def test_durations_of_weeks_pass_through_seconds_unchanged(nanoseconds):
    assert to_ns(to_s(nanoseconds)) == nanoseconds


def test_seconds_are_rounded_not_cut():
    assert to_ns(0.3) == 300_000_000
    assert to_ns(-1.9999999999) == -2 * NS_PER_S
