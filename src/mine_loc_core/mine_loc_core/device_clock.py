"""Device time to ROS time: offset and drift from the lower envelope of (arrival − device time).

A message can be late but never early, so the true offset lies on the lower edge of the cloud of arrival minus device
time. The lower convex hull of that cloud over a window gives offset and drift at once (Moon, Skelly & Towsley,
INFOCOM 1999); delay spikes and Wi-Fi stalls lie above the hull and do not move it.
"""

from collections import deque
from dataclasses import dataclass
from enum import IntEnum

from mine_loc_core.stamps import NS_PER_MS, NS_PER_S

_BIN_NS = NS_PER_S
_WINDOW_BINS = 60
_LOCKED_AFTER_BINS = 10
_MAX_SKEW = 200e-6  # a crystal is within ±40 ppm; two of them and temperature leave room below this
_STEP_NS = 500 * NS_PER_MS  # beyond the stalls of a Wi-Fi bridge (hardware.md A.8)
_STEP_CONFIRM_NS = 700 * NS_PER_MS
_HOLDOVER_DELAY_NS = 50 * NS_PER_MS
_HOLDOVER_AFTER_NS = 5 * NS_PER_S
_DEVICE_EPOCH_NS = 1 << 62  # device time counts modulo 146 years, which keeps offsets within the messages' int64


class SyncState(IntEnum):
    """Constants of UwbRangeArray.sync_state."""

    UNKNOWN = 0
    FREE_RUNNING = 1
    CONVERGING = 2
    LOCKED = 3
    HOLDOVER = 4


@dataclass(frozen=True, slots=True)
class DeviceStamp:
    """Instant of a device event in ROS time and how it came about.

    `reset` says why the mapping started anew with this event (empty = it did not).
    """

    stamp_ns: int
    offset_ns: int
    skew_ppm: float
    state: SyncState
    reset: str = ""


class DeviceClock:
    """Maps the counter of one device to ROS time.

    `tick_s` is the length of a tick, `counter_bits` the width at which the counter wraps, `latency_ns` a known
    constant delay between the event and its earliest arrival, `bypass` stamps on arrival instead.
    """

    def __init__(self, tick_s: float, counter_bits: int, *, latency_ns: int = 0, bypass: bool = False) -> None:
        self._tick_ns = tick_s * 1e9
        self._modulus = 1 << counter_bits
        self._latency_ns = latency_ns
        self._bypass = bypass
        self.resets = 0
        self._last_stamp_ns: int | None = None
        self._forget()

    def _forget(self) -> None:
        self._last_ticks: int | None = None
        self._ticks = 0  # since the first event, so that large counters do not cost precision
        self._first_ns = 0
        self._last_arrival_ns = 0
        self._bins: deque[tuple[int, int]] = deque(maxlen=_WINDOW_BINS)  # (device ns, arrival − device ns) minima
        self._line = (0, 0, 0.0)  # (device ns, difference ns there, slope)
        self._step_since_ns: int | None = None
        self._on_time_ns = 0

    def stamp(self, ticks: int | None, arrival_ns: int) -> DeviceStamp:
        """Stamp an event that the device counted at `ticks` and that arrived at `arrival_ns` (ROS time).

        Stamps never lie after the arrival, and do not go back while the device counts forward.
        """
        if ticks is None or self._bypass:
            return DeviceStamp(arrival_ns - self._latency_ns, 0, 0.0, SyncState.FREE_RUNNING)
        reset = self._unwrap(ticks, arrival_ns)
        device_ns = self._device_ns
        if not reset and (arrival_ns < (self._last_stamp_ns or 0) or self._stepped(device_ns, arrival_ns)):
            reset = "step"
        if reset:
            self.resets += 1
            self._forget()
            self._unwrap(ticks, arrival_ns)
            device_ns = self._device_ns
            self._last_stamp_ns = None
        self._observe(device_ns, arrival_ns - device_ns)
        offset_ns = self._difference_at(device_ns)
        stamp_ns = min(device_ns + offset_ns, arrival_ns) - self._latency_ns
        if self._last_stamp_ns is not None:
            stamp_ns = max(stamp_ns, self._last_stamp_ns)
        self._last_stamp_ns = stamp_ns
        return DeviceStamp(
            stamp_ns, offset_ns, self._line[2] * 1e6, self._state(arrival_ns - device_ns, offset_ns, arrival_ns), reset
        )

    @property
    def _device_ns(self) -> int:
        return self._first_ns + round(self._ticks * self._tick_ns)

    def _unwrap(self, ticks: int, arrival_ns: int) -> str:
        """Extend the counter past its width; answers why the device must have restarted, or nothing."""
        if self._last_ticks is None:
            self._first_ns = round(ticks * self._tick_ns) % _DEVICE_EPOCH_NS
        else:
            forward = (ticks - self._last_ticks) % self._modulus
            elapsed = (arrival_ns - self._last_arrival_ns) / self._tick_ns
            wraps = max(0, round((elapsed - forward) / self._modulus))
            repeated = forward == 0 and wraps == 0
            if not repeated and (forward + wraps * self._modulus - elapsed) * self._tick_ns > 10 * NS_PER_S:
                return "restart"
            self._ticks += forward + wraps * self._modulus
        self._last_ticks, self._last_arrival_ns = ticks, arrival_ns
        return ""

    def _stepped(self, device_ns: int, arrival_ns: int) -> bool:
        """Whether one of the two clocks jumped: early at once, late when it stays late at an even distance."""
        if not self._bins:
            return False
        excess_ns = arrival_ns - device_ns - self._difference_at(device_ns)
        if excess_ns < -_STEP_NS:
            return True
        if excess_ns < _STEP_NS:
            self._step_since_ns = None
            return False
        if self._step_since_ns is None:
            self._step_since_ns, self._step_excess_ns = arrival_ns, excess_ns
        # A stall drains: its excess shrinks as fast as data come. A step keeps its size.
        if self._step_excess_ns - excess_ns > _STEP_NS // 4:
            self._step_since_ns, self._step_excess_ns = arrival_ns, excess_ns
        return arrival_ns - self._step_since_ns > _STEP_CONFIRM_NS

    def _observe(self, device_ns: int, difference_ns: int) -> None:
        if self._bins and device_ns // _BIN_NS == self._bins[-1][0] // _BIN_NS:
            if difference_ns >= self._bins[-1][1]:
                return
            self._bins[-1] = (device_ns, difference_ns)
        else:
            self._bins.append((device_ns, difference_ns))
        self._line = _supporting_line(list(self._bins))

    def _difference_at(self, device_ns: int) -> int:
        at_ns, difference_ns, slope = self._line
        return difference_ns + round(slope * (device_ns - at_ns))

    def _state(self, difference_ns: int, offset_ns: int, arrival_ns: int) -> SyncState:
        if difference_ns - offset_ns < _HOLDOVER_DELAY_NS:
            self._on_time_ns = arrival_ns
        if arrival_ns - self._on_time_ns > _HOLDOVER_AFTER_NS:
            return SyncState.HOLDOVER
        return SyncState.LOCKED if len(self._bins) >= _LOCKED_AFTER_BINS else SyncState.CONVERGING


def _supporting_line(points: list[tuple[int, int]]) -> tuple[int, int, float]:
    """The edge of the lower convex hull below the mean time: (time, value there, slope).

    Until drift shows (too few points), and where it would exceed what crystals do, a level line through the minimum.
    """
    lowest = min(points, key=lambda p: p[1])
    if len(points) < _LOCKED_AFTER_BINS:
        return lowest[0], lowest[1], 0.0
    hull: list[tuple[int, int]] = []
    for t, d in points:
        while len(hull) > 1 and _turns_down(hull[-2], hull[-1], (t, d)):
            hull.pop()
        hull.append((t, d))
    mean_t = sum(t for t, _ in points) / len(points)
    right = next((i for i in range(1, len(hull)) if hull[i][0] >= mean_t), len(hull) - 1)
    (t0, d0), (t1, d1) = hull[right - 1], hull[right]
    slope = (d1 - d0) / (t1 - t0)
    if abs(slope) > _MAX_SKEW:
        return lowest[0], lowest[1], 0.0
    return t0, d0, slope


def _turns_down(a: tuple[int, int], b: tuple[int, int], c: tuple[int, int]) -> bool:
    return (b[1] - a[1]) * (c[0] - a[0]) >= (c[1] - a[1]) * (b[0] - a[0])
