"""Integer nanoseconds and tuples as ROS messages."""

import pytest
from builtin_interfaces.msg import Time
from hypothesis import given
from hypothesis import strategies as st

from mine_loc_core.nodes.conversions import to_point, to_time
from mine_loc_core.stamps import to_stamp_ns


@given(st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1))
def test_a_stamp_passes_through_a_message_unchanged(stamp_ns):
    assert to_stamp_ns(to_time(stamp_ns)) == stamp_ns


@pytest.mark.parametrize(
    ("stamp_ns", "time"), [(-1, (-1, 999_999_999)), (0, (0, 0)), (1_500_000_000, (1, 500_000_000))]
)
def test_nanoseconds_of_a_message_are_never_negative(stamp_ns, time):
    assert to_time(stamp_ns) == Time(sec=time[0], nanosec=time[1])


def test_a_point_has_the_three_coordinates_in_order():
    point = to_point((1, 2.5, -3))
    assert (point.x, point.y, point.z) == (1.0, 2.5, -3.0)
