"""Stamping the messages of one serial line: one clock for each device behind it, and the count of rounds lost."""

from collections import OrderedDict

from mine_loc_core.device_clock import DeviceClock, DeviceStamp
from mine_loc_uwb.wire.decoder import Decoder

_MAX_DEVICES = 4096


class DeviceStamps:
    """Clocks and sequence counters of the devices that one line carries, found by a key (ids of the units).

    The devices heard longest ago are forgotten first when there are more than a gateway serves.
    """

    def __init__(self, *, latency_ns: int, trust_device_clock: bool) -> None:
        self._latency_ns = latency_ns
        self._trust = trust_device_clock
        self._clocks: OrderedDict[tuple[int, ...], DeviceClock] = OrderedDict()
        self._sequences: OrderedDict[tuple[int, ...], int] = OrderedDict()
        self._rounds: OrderedDict[int, tuple[int, DeviceStamp]] = OrderedDict()
        self.lost_rounds = 0
        self.clock_resets = 0

    def stamp(self, key: tuple[int, ...], decoder: Decoder, ticks: int | None, arrival_ns: int) -> DeviceStamp:
        """Instant of an event that the device behind `key` counted at `ticks`."""
        clock = self._clocks.get(key)
        if clock is None:
            usable = self._trust and decoder.counter_bits > 0
            clock = DeviceClock(
                decoder.tick_period_s, max(decoder.counter_bits, 1), latency_ns=self._latency_ns, bypass=not usable
            )
            self._clocks[key] = clock
        self._clocks.move_to_end(key)
        if len(self._clocks) > _MAX_DEVICES:
            self._clocks.popitem(last=False)
        stamp = clock.stamp(ticks, arrival_ns)
        if stamp.reset:
            self.clock_resets += 1
        return stamp

    def remember_round(self, tag_id: int, seq: int, stamp: DeviceStamp) -> None:
        """Keep number and stamp of a tag's latest round for the accumulators of its receptions."""
        self._rounds[tag_id] = (seq, stamp)
        self._rounds.move_to_end(tag_id)
        if len(self._rounds) > _MAX_DEVICES:
            self._rounds.popitem(last=False)

    def stamp_of_round(self, tag_id: int, seq: int) -> DeviceStamp | None:
        """The stamp that a tag's latest round was given; None if that round has another number."""
        known = self._rounds.get(tag_id)
        return known[1] if known is not None and known[0] == seq else None

    def number(self, key: tuple[int, ...], decoder: Decoder, seq: int | None) -> int:
        """The round's number, counted here where the device has no counter; gaps count as lost rounds."""
        last = self._sequences.get(key)
        if seq is None or not decoder.seq_bits:
            seq = 0 if last is None else (last + 1) % 2**32
        elif last is not None:
            gap = (seq - last) % 2**decoder.seq_bits
            if 1 < gap < 2 ** (decoder.seq_bits - 1):
                self.lost_rounds += gap - 1
        self._sequences[key] = seq
        self._sequences.move_to_end(key)
        if len(self._sequences) > _MAX_DEVICES:
            self._sequences.popitem(last=False)
        return seq

    def forget(self) -> None:
        """Start anew: time jumped, or another device may be on the line."""
        self._clocks.clear()
        self._sequences.clear()
        self._rounds.clear()
