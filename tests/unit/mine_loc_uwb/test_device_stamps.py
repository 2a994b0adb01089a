"""One clock for each device on a line, and the count of rounds lost."""

import pytest

from mine_loc_core.device_clock import SyncState
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_uwb.device_stamps import DeviceStamps
from mine_loc_uwb.wire.decoder import TextDecoder

T0 = 1_760_000_000 * NS_PER_S


def decoder(**options):
    return TextDecoder("x", lambda _: None, **({"tick_period_s": 1e-3, "counter_bits": 32, "seq_bits": 8} | options))


def stamps(*, trust=True, latency_ns=0):
    return DeviceStamps(latency_ns=latency_ns, trust_device_clock=trust)


@pytest.mark.parametrize(
    ("numbers", "lost"),
    [([1, 2, 3], 0), ([1, 4], 2), ([254, 255, 0, 1], 0), ([254, 2], 3), ([5, 5], 0), ([200, 3], 58), ([100, 0], 0)],
)
def test_gaps_in_the_device_count_are_lost_rounds_and_repeats_and_restarts_are_not(numbers, lost):
    subject = stamps()
    assert [subject.number((1,), decoder(), seq) for seq in numbers] == numbers
    assert subject.lost_rounds == lost


@pytest.mark.parametrize(("seq", "bits"), [(None, 8), (17, 0)])
def test_rounds_without_a_usable_count_are_counted_here(seq, bits):
    subject = stamps()
    assert [subject.number((1,), decoder(seq_bits=bits), seq) for _ in range(3)] == [0, 1, 2]
    assert subject.lost_rounds == 0


def test_each_device_has_a_clock_of_its_own():
    subject = stamps()
    subject.stamp((1,), decoder(), 1000, T0)
    subject.stamp((2,), decoder(), 900_000_000, T0)
    assert subject.stamp((1,), decoder(), 1100, T0 + 130 * NS_PER_MS).stamp_ns == T0 + 100 * NS_PER_MS
    assert subject.stamp((2,), decoder(), 900_000_100, T0 + 130 * NS_PER_MS).stamp_ns == T0 + 100 * NS_PER_MS
    assert subject.clock_resets == 0


@pytest.mark.parametrize(("trust", "bits"), [(False, 32), (True, 0)])
def test_an_untrusted_or_missing_clock_stamps_on_arrival(trust, bits):
    stamp = stamps(trust=trust, latency_ns=5).stamp((1,), decoder(counter_bits=bits), 1000, T0)
    assert (stamp.stamp_ns, stamp.state) == (T0 - 5, SyncState.FREE_RUNNING)


def test_a_device_that_restarts_is_counted():
    subject = stamps()
    subject.stamp((1,), decoder(), 10_000_000, T0)
    assert subject.stamp((1,), decoder(), 5, T0 + 50 * NS_PER_MS).reset == "restart"
    assert subject.clock_resets == 1


def test_forgetting_starts_clocks_and_counts_anew():
    subject = stamps()
    subject.stamp((1,), decoder(), 1000, T0)
    subject.number((1,), decoder(), 1)
    subject.forget()
    assert subject.stamp((1,), decoder(), 1100, T0 + 130 * NS_PER_MS).stamp_ns == T0 + 130 * NS_PER_MS
    subject.number((1,), decoder(), 90)
    assert subject.lost_rounds == 0


def test_devices_heard_longest_ago_are_forgotten_first():
    subject = stamps()
    for key in range(5000):
        subject.number((key,), decoder(), 1)
        subject.stamp((key,), decoder(), 1000, T0)
        subject.number((0,), decoder(), key + 1)
    assert subject.lost_rounds == 0
    assert len(subject._sequences) == len(subject._clocks) == 4096
    assert (0,) in subject._sequences
