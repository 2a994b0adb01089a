"""From rounds as measured to what devices report of them: ids, counters, device clocks, losses, and on which line."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import nan

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.people import Person
from mine_loc_core.site import Site, UwbReceiver
from mine_loc_sim import scene_constants as sc
from mine_loc_sim.device_ticks import DeviceTicks
from mine_loc_sim.scene import SceneOptions, reporting_lines, wire_format
from mine_loc_sim.tag_radio import CHANNEL, PRF_MHZ, HeardRound
from mine_loc_sim.tdoa_blink import AnchorSync, range_differences
from mine_loc_uwb.ranging import CirWindow, Range, RangingRound, TdoaBlink, TdoaDifference
from mine_loc_uwb.received_power import Reception, powers_dbm

_TICKS_PER_US = 63_897.6
_COUNTER = 1 << 40


@dataclass(frozen=True, slots=True)
class ReportedRound:
    """A round as a device knows it: raw ranges with the registers behind them and the known bias by level [m]."""

    ranging: RangingRound
    heard: HeardRound


@dataclass(frozen=True, slots=True)
class ReportedCir:
    """An accumulator with the registers that the wire carries beside it."""

    window: CirWindow
    reception: Reception


Report = ReportedRound | ReportedCir | TdoaBlink


class UwbClock:
    """Microseconds since power-up as firmware counts them, by unwrapping the 40-bit counter of its DW1000."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._ticks = DeviceTicks(rng)
        self._counted = int(rng.integers(_COUNTER * 1000))
        self._last: int | None = None

    @property
    def rate_ppm(self) -> float:
        """How much too fast it runs now."""
        return self._ticks.rate_ppm

    def at_us(self, stamp_ns: int) -> int:
        """Count at an instant, none before the last one and none more than 17 s after it."""
        ticks = self._ticks.at(stamp_ns)
        self._counted += 0 if self._last is None else (ticks - self._last) % _COUNTER
        self._last = ticks
        return round(self._counted / _TICKS_PER_US)


class Reporters:
    """The devices behind the UWB lines of a site; rounds must come in order of time."""

    def __init__(
        self,
        site: Site,
        people: Sequence[Person],
        anchors_m: NDArray[np.float64],
        rng: np.random.Generator,
        options: SceneOptions,
    ) -> None:
        self._ids = [anchor.id for anchor in site.anchors]
        self._options = options
        self._rng, sync, *clocks = rng.spawn(2 + len(self._ids) + len(people))
        self._sync, self._sync_ns = AnchorSync(max(len(self._ids), 1), sync), 0
        self._anchor_clocks = [UwbClock(each) for each in clocks[: len(self._ids)]]
        tagged = [person.tag_id for person in people if person.tag_id]
        self._tag_clocks = {tag: UwbClock(each) for tag, each in zip(tagged, clocks[len(self._ids) :], strict=False)}
        self._rounds = {tag: int(self._rng.integers(2**16)) for tag in tagged}
        places_m = dict(zip(self._ids, anchors_m.tolist(), strict=True))
        self._places_m = {r.name: places_m[r.anchor_id] for r in site.uwb_receivers if r.anchor_id is not None}
        self._lines = {tag: reporting_lines(site, tag) for tag in tagged}

    def report(self, person: Person, heard: HeardRound) -> Iterator[tuple[str, Report]]:
        """Yield what is said of a round, with the line that says it; nothing of a round that is lost on its way."""
        tag_id = person.tag_id
        self._rounds[tag_id] = (self._rounds[tag_id] + 1) % 2**32
        time_us = self._tag_clocks[tag_id].at_us(heard.stamp_ns)
        rates = [self._anchor_clocks[number].rate_ppm for number in heard.which.tolist()]
        lost = self._rng.random() < sc.LOST_ROUND_SHARE
        line = self._line(tag_id, heard)
        if lost or line is None or not len(heard.which):
            return
        reporter_id = line.anchor_id or tag_id
        ranging = self._ranging(tag_id, reporter_id, time_us, heard, rates)
        yield line.name, ReportedRound(ranging, heard)
        if wire_format(line) != "mine_loc":
            return
        if self._options.tdoa and len(heard.which) > 1 and np.isfinite(heard.range_m[0]):
            yield line.name, self._blink(tag_id, heard)
        if heard.accumulators is not None:
            yield from ((line.name, window) for window in _windows(ranging, heard))

    def _line(self, tag_id: int, heard: HeardRound) -> UwbReceiver | None:
        """The tag's own line, or that of the anchor which is nearest of those that have one, or of the gateway."""
        lines = self._lines[tag_id]
        anchors = [line for line in lines if line.anchor_id is not None]
        if not anchors:
            return lines[0] if lines else None
        if len(anchors) == 1:
            return anchors[0]
        tag_m = heard.tag_m.tolist()
        return min(anchors, key=lambda line: math.dist(self._places_m[line.name], tag_m))

    def _ranging(
        self, tag_id: int, reporter_id: int, time_us: int, heard: HeardRound, rates_ppm: Sequence[float]
    ) -> RangingRound:
        own_ppm = self._tag_clocks[tag_id].rate_ppm
        errors_ppm = sc.CARRIER_OFFSET_SD_PPM * self._rng.standard_normal(len(rates_ppm))
        columns = (heard.which.tolist(), heard.range_m.tolist(), heard.receptions, rates_ppm, errors_ppm.tolist())
        ranges = []
        for anchor, range_m, reception, rate_ppm, error_ppm in zip(*columns, strict=True):
            offset_ppm = nan if math.isnan(range_m) else rate_ppm - own_ppm + error_ppm
            powers = _powers_dbm(reception)
            ranges.append(Range(self._ids[anchor], range_m, *powers, reception.first_path_index, offset_ppm))
        return RangingRound(tag_id, reporter_id, self._rounds[tag_id], time_us, tuple(ranges), corrected=False)

    def _blink(self, tag_id: int, heard: HeardRound) -> TdoaBlink:
        """Differences to the first anchor, by whose clock the blink is stamped."""
        differences = range_differences(heard.range_m, self._sync_at(heard.stamp_ns)[heard.which], 0)
        powers = [_powers_dbm(reception) for reception in heard.receptions]
        reference = int(heard.which[0])
        others = tuple(
            TdoaDifference(self._ids[heard.which[i]], float(differences[i]), powers[i][1], powers[i][0])
            for i in range(1, len(powers))
        )
        time_us = self._anchor_clocks[reference].at_us(heard.stamp_ns)
        return TdoaBlink(tag_id, self._rounds[tag_id], time_us, self._ids[reference], powers[0][1], others)

    def _sync_at(self, stamp_ns: int) -> NDArray[np.float64]:
        gone_s, self._sync_ns = (stamp_ns - self._sync_ns) * 1e-9, stamp_ns
        return self._sync.advance(gone_s)


@lru_cache(1 << 13)  # without accumulators, registers come from a table and come again
def _powers_dbm(reception: Reception) -> tuple[float, float]:
    return powers_dbm(reception)


def _windows(ranging: RangingRound, heard: HeardRound) -> Iterator[ReportedCir]:
    """Whole accumulators of the exchanges that succeeded."""
    assert heard.accumulators is not None
    for number, (measured, reception) in enumerate(zip(ranging.ranges, heard.receptions, strict=True)):
        if not reception.preamble_count:
            continue
        samples = heard.accumulators[number]
        window = CirWindow(
            tag_id=ranging.tag_id,
            anchor_id=measured.anchor_id,
            seq=ranging.seq or 0,
            device_ticks=ranging.device_ticks or 0,
            range_m=measured.range_m,
            first_path_index=measured.first_path_index,
            start_index=0,
            preamble_count=reception.preamble_count,
            noise_std=float(reception.noise_std) if reception.noise_std else nan,
            first_path_amplitude=reception.first_path_amplitude,
            receive_power_counts=reception.receive_power_counts,
            channel=CHANNEL,
            prf_mhz=PRF_MHZ,
            in_phase=np.clip(samples.real, -32768, 32767).astype(np.int16),
            quadrature=np.clip(samples.imag, -32768, 32767).astype(np.int16),
            first_path_power_dbm=measured.first_path_power_dbm,
            receive_power_dbm=measured.receive_power_dbm,
        )
        yield ReportedCir(window, reception)
