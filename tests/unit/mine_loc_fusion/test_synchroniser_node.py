"""What the synchroniser reads from messages."""

import math

import pytest

pytest.importorskip("rclpy")

from mine_loc_interfaces import msg

from mine_loc_fusion.nodes.synchroniser import links_received


def test_a_failed_exchange_has_no_link_state_to_wait_for():
    ranges = [msg.UwbRange(anchor_id=number, range_raw=value) for number, value in enumerate((4.0, math.nan, 5.0))]
    assert links_received(msg.UwbRangeArray(ranges=ranges)) == 2
