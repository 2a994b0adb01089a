"""Device time to ROS time: never worse than the arrival, whatever the line and the two clocks do."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mine_loc_core.device_clock import DeviceClock, SyncState
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S

EPOCH_NS = 1_760_000_000 * NS_PER_S
DW1000_TICK_S = 1.0 / (128 * 499.2e6)
DW1000_WRAP_NS = round(2**40 * DW1000_TICK_S * 1e9)
PERIOD_NS = 50 * NS_PER_MS


class Device:
    """A counter that drifts against ROS time, and a line that delays."""

    def __init__(self, tick_s=DW1000_TICK_S, bits=40, *, skew=0.0, start_ticks=0):
        self.tick_ns, self.modulus = tick_s * 1e9, 2**bits
        self.skew, self.start_ticks = skew, start_ticks

    def ticks(self, true_ns):
        return (self.start_ticks + int((true_ns - EPOCH_NS) * (1 + self.skew) / self.tick_ns)) % self.modulus


def clock(tick_s=DW1000_TICK_S, bits=40, **options):
    return DeviceClock(tick_s, bits, **options)


def run(subject, device, seconds, *, start_s=0.0, delay=lambda _: 3 * NS_PER_MS, host_step_ns=0):
    """(truth, arrival, stamp) of events every 50 ms, as ROS time after the host's step sees them."""
    rows = []
    for i in range(round(seconds * NS_PER_S / PERIOD_NS)):
        true_ns = EPOCH_NS + round(start_s * NS_PER_S) + i * PERIOD_NS
        arrival_ns = true_ns + delay(i) + host_step_ns
        rows.append((true_ns + host_step_ns, arrival_ns, subject.stamp(device.ticks(true_ns), arrival_ns)))
    return rows


def errors_ms(rows):
    return np.array([(stamp.stamp_ns - truth) / NS_PER_MS for truth, _, stamp in rows])


def line_of(rng, count, *, jitter_ms, spikes, stall_ms):
    """Arrival delays of a first-in-first-out line: queueing jitter, spikes, and stalls that end in a burst."""
    delays = 1.0 + rng.exponential(jitter_ms, count)
    delays[rng.random(count) < spikes] += rng.uniform(20.0, 200.0)
    at_ms = np.arange(count) * PERIOD_NS / NS_PER_MS
    for begin in rng.uniform(0.0, at_ms[-1], 4):
        held = (at_ms + delays >= begin) & (at_ms + delays < begin + stall_ms)
        delays[held] = begin + stall_ms - at_ms[held]
    return np.rint(np.maximum.accumulate(at_ms + delays) * NS_PER_MS).astype(np.int64)


@settings(max_examples=15)
@given(
    seed=st.integers(0, 2**32 - 1),
    skew=st.floats(-50e-6, 50e-6),
    jitter_ms=st.floats(2.0, 20.0),
    spikes=st.floats(0.0, 0.1),
    stall_ms=st.sampled_from([0.0, 100.0, 500.0]),
)
def test_corrected_stamps_scatter_no_more_than_arrivals_and_keep_order(seed, skew, jitter_ms, spikes, stall_ms):
    arrivals = line_of(np.random.default_rng(seed), 1200, jitter_ms=jitter_ms, spikes=spikes, stall_ms=stall_ms)
    device, subject, bypassed = Device(skew=skew), clock(), clock(bypass=True)
    corrected, raw, applied = [], [], 0
    last_ns = 0
    for i, offset_ns in enumerate(arrivals.tolist()):
        true_ns, arrival_ns = EPOCH_NS + i * PERIOD_NS, EPOCH_NS + offset_ns
        stamp = subject.stamp(device.ticks(true_ns), arrival_ns)
        assert last_ns <= stamp.stamp_ns <= arrival_ns
        assert stamp.reset == ""
        last_ns = stamp.stamp_ns
        applied += stamp.stamp_ns != bypassed.stamp(device.ticks(true_ns), arrival_ns).stamp_ns
        corrected.append((stamp.stamp_ns - true_ns) / NS_PER_MS)
        raw.append((arrival_ns - true_ns) / NS_PER_MS)
    assert applied > len(raw) / 2
    assert np.std(corrected) <= np.std(raw)
    settled = slice(300, None)
    assert np.std(corrected[settled]) <= 0.5 * np.std(raw[settled])


def test_skew_is_found_and_the_state_tells_how_far_the_mapping_is():
    rng = np.random.default_rng(1)
    rows = run(clock(), Device(skew=-40e-6), 60, delay=lambda _: 2 * NS_PER_MS + int(rng.exponential(2e6)))
    assert rows[0][2].state is SyncState.CONVERGING
    assert rows[-1][2].state is SyncState.LOCKED
    assert rows[-1][2].skew_ppm == pytest.approx(40.0, abs=5.0)
    assert np.abs(errors_ms(rows[400:]) - 2.0).max() < 1.0


def test_a_known_latency_is_taken_off():
    rows = run(clock(latency_ns=3 * NS_PER_MS), Device(), 5)
    assert np.abs(errors_ms(rows)).max() < 0.001


@pytest.mark.parametrize("bypass", [True, False])
def test_without_device_time_the_stamp_is_the_arrival(bypass):
    subject = clock(bypass=bypass, latency_ns=5)
    stamp = subject.stamp(123 if bypass else None, EPOCH_NS)
    assert stamp.stamp_ns == EPOCH_NS - 5
    assert stamp.state is SyncState.FREE_RUNNING


@pytest.mark.parametrize(
    ("tick_s", "bits", "start_ticks"),
    [(DW1000_TICK_S, 40, 2**40 - 10**9), (1e-3, 32, 2**32 - 5000), (1e-6, 64, 2**64 - 5_000_000)],
)
def test_the_counter_may_wrap(tick_s, bits, start_ticks):
    subject = clock(tick_s, bits)
    rows = run(subject, Device(tick_s, bits, start_ticks=start_ticks), 40)
    assert subject.resets == 0
    assert np.abs(errors_ms(rows) - 3.0).max() <= tick_s * 1e3 + 0.001


@settings(max_examples=12)
@given(silence_s=st.floats(0.1, 120.0))
def test_silence_longer_than_a_wrap_does_not_shift_the_stamps(silence_s):
    subject, device = clock(), Device(skew=20e-6, start_ticks=7 * 10**11)
    run(subject, device, 20)
    rows = run(subject, device, 20, start_s=20 + silence_s)
    assert subject.resets == 0
    assert np.abs(errors_ms(rows) - 3.0).max() < 5.0


@pytest.mark.parametrize(("tick_s", "bits", "runs_s"), [(DW1000_TICK_S, 40, 12), (1e-3, 32, 12), (1e-6, 64, 12)])
def test_a_device_that_restarts_is_stamped_right_again_within_a_second(tick_s, bits, runs_s):
    subject = clock(tick_s, bits)
    run(subject, Device(tick_s, bits, start_ticks=10**9 % 2**bits), runs_s)
    restarted = Device(tick_s, bits, start_ticks=-int(runs_s / tick_s))
    rows = run(subject, restarted, 5, start_s=runs_s)
    assert subject.resets >= 1
    assert any(stamp.reset for _, _, stamp in rows)
    assert np.abs(errors_ms(rows[20:]) - 3.0).max() < 5.0


@pytest.mark.parametrize("step_s", [0.8, 5.0, 3600.0, -0.8, -5.0, -3600.0])
def test_a_step_of_the_host_clock_is_followed_within_a_second_and_told(step_s):
    subject, device = clock(), Device(skew=-30e-6)
    run(subject, device, 20)
    rows = run(subject, device, 5, start_s=20, host_step_ns=round(step_s * NS_PER_S))
    assert {stamp.reset for _, _, stamp in rows} & {"step", "restart"}
    assert np.abs(errors_ms(rows[20:]) - 3.0).max() < 5.0


@settings(max_examples=50)
@given(steps=st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=4))
def test_no_step_of_the_host_clock_puts_a_stamp_after_its_arrival(steps):
    subject, device, step_s = clock(), Device(), 0.0
    for i, change_s in enumerate([0.0, *steps]):
        step_s += change_s
        for _, arrival_ns, stamp in run(subject, device, 3, start_s=3 * i, host_step_ns=round(step_s * NS_PER_S)):
            assert stamp.stamp_ns <= arrival_ns


def test_repeated_ticks_do_not_reset_and_stay_before_the_arrival():
    subject = clock()
    first = subject.stamp(10**6, EPOCH_NS)
    again = [subject.stamp(10**6, EPOCH_NS + i * NS_PER_MS) for i in range(3)]
    assert subject.resets == 0
    assert all(first.stamp_ns <= stamp.stamp_ns <= EPOCH_NS + i * NS_PER_MS for i, stamp in enumerate(again))


def test_frames_of_one_burst_keep_their_distance_in_device_time():
    subject, device = clock(), Device()
    run(subject, device, 10)
    burst_ns = EPOCH_NS + 11 * NS_PER_S
    stamps = [
        subject.stamp(device.ticks(burst_ns - (9 - i) * PERIOD_NS - 3 * NS_PER_MS), burst_ns).stamp_ns
        for i in range(10)
    ]
    assert np.diff(stamps) == pytest.approx(PERIOD_NS, abs=1000)


def test_holdover_is_told_while_nothing_arrives_on_time_and_ends_when_something_does():
    subject, device = clock(), Device()
    run(subject, device, 20)
    congested = run(subject, device, 10, start_s=20, delay=lambda i: (200 + i % 7) * NS_PER_MS)
    assert congested[-1][2].state is SyncState.HOLDOVER
    assert np.abs(errors_ms(congested) - 3.0).max() < 1.0
    assert run(subject, device, 1, start_s=31)[-1][2].state is SyncState.LOCKED


def test_a_long_stall_that_drains_is_not_taken_for_a_step():
    subject, device = clock(), Device()
    run(subject, device, 20)
    stalled = run(subject, device, 3, start_s=20, delay=lambda i: max(3, 3000 - 50 * i) * NS_PER_MS)
    assert subject.resets == 0
    assert np.abs(errors_ms(stalled) - 3.0).max() < 1.0
