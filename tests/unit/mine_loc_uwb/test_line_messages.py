"""What belongs to one instant bears one stamp: accumulators and the round they were received in."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("rclpy")

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S, to_stamp_ns
from mine_loc_uwb.device_stamps import DeviceStamps
from mine_loc_uwb.nodes.line_messages import LineIds, stamped_message
from mine_loc_uwb.ranging import CirWindow, Range, RangingRound
from mine_loc_uwb.wire.detect import make_decoder

T0 = 1_760_000_000 * NS_PER_S


@pytest.fixture
def stamped():
    decoder, stamps = make_decoder("mine_loc"), DeviceStamps(latency_ns=0, trust_device_clock=True)
    return lambda message, arrival_ns: stamped_message(message, decoder, stamps, T0 + arrival_ns, LineIds(), 0.1)


def ranging(seq, time_us, tag=7):
    return RangingRound(tag, 1, seq, time_us, (Range(2, 4.0), Range(3, 5.0)), corrected=True)


def window(seq, time_us, anchor=2, tag=7):
    samples = np.zeros(4, np.int16)
    return CirWindow(tag, anchor, seq, time_us, 4.0, 745.0, 744, 400, 40.0, (1, 2, 3), 9, 5, 64, samples, samples)


def test_accumulators_bear_the_stamp_of_their_round_however_late_they_come(stamped):
    """Jitter of arrivals, and a reception some milliseconds into its round, would part them."""
    for number in range(20):
        time_us, arrival_ns = 1_000_000 + 100_000 * number, (100 * number + number % 7) * NS_PER_MS
        first = stamped(ranging(number, time_us), arrival_ns)
        later = [stamped((window(number, time_us + 1500, anchor),), arrival_ns + 9 * NS_PER_MS) for anchor in (2, 3)]
        assert {to_stamp_ns(each.header.stamp) for each in later} == {to_stamp_ns(first.header.stamp)}
        assert {frame.range_seq for each in later for frame in each.frames} == {first.seq}
        assert all(frame.header == each.header for each in later for frame in each.frames)


@pytest.mark.parametrize("other", [{"seq": 9}, {"tag_id": 8}])
def test_an_accumulator_of_another_round_or_tag_has_a_stamp_of_its_own(stamped, other):
    round_ns = to_stamp_ns(stamped(ranging(3, 1_000_000), 0).header.stamp)
    stray = stamped((replace(window(3, 1_050_000), **other),), 50 * NS_PER_MS)
    assert to_stamp_ns(stray.header.stamp) == round_ns + 50 * NS_PER_MS
