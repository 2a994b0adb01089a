"""Direction-finding monitors that listen to moving emitters: what each reports, when it says so, and the truth.

All monitors scan the channels in step, so reports of one emission bear one stamp, which is what paper E associates by.
Bearings are straight: neither rock nor walls bend, weaken or mirror them.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.site import Monitor
from mine_loc_core.stamps import NS_PER_S
from mine_loc_sim import bearing_constants as bc

Array = NDArray[np.float64]
Track = Callable[[NDArray[np.int64]], Array]
"""Positions (n, 3) [m] of an emitter in the map at stamps (n,)."""
Sent = tuple[int, BearingReport]
"""When a report leaves its monitor, and the report."""
_LIGHT_M_S = 299_792_458.0


@dataclass(frozen=True, slots=True)
class MonitorErrors:
    """How well monitors hear. `bias_rad` is the constant error of single monitors by id, 0 for the others."""

    detection_range_m: float = bc.DETECTION_RANGE_M
    noise_sd_rad: float = bc.NOISE_SD_RAD
    bias_rad: Mapping[int, float] = field(default_factory=dict)
    longest_delay_ns: int = bc.LONGEST_DELAY_NS
    lost_share: float = bc.LOST_SHARE

    def __post_init__(self) -> None:
        if not self.detection_range_m > 0.0:
            raise ConfigurationError(f"detection_range_m: {self.detection_range_m:g}; allowed: above 0")
        if not 0.0 <= self.noise_sd_rad <= math.pi:
            raise ConfigurationError(f"noise_sd_rad: {self.noise_sd_rad:g}; allowed: 0 to pi")
        if self.longest_delay_ns < 0:
            raise ConfigurationError(f"longest_delay_ns: {self.longest_delay_ns}; allowed: 0 and above")
        if not 0.0 <= self.lost_share <= 1.0:
            raise ConfigurationError(f"lost_share: {self.lost_share:g}; allowed: 0 to 1")


@dataclass(frozen=True, slots=True)
class TrueBearing:
    """Truth of one bearing: ENU yaw and distance in plan to where the emitter was, error of the reported azimuth.

    `sent_ns` is when the report left the monitor, None for a lost one.
    """

    stamp_ns: int
    monitor_id: int
    emitter: str
    channel: int
    azimuth_rad: float
    distance_m: float
    error_rad: float
    sent_ns: int | None


class BearingEmulator:
    """The monitors of a place and the emitters in it, played forward in time from 0."""

    def __init__(
        self,
        monitors: Sequence[Monitor],
        tracks: Mapping[str, Track],
        errors: MonitorErrors,
        rng: np.random.Generator,
    ) -> None:
        self._monitors = tuple(monitors)
        self._places_m = np.array([monitor.position_m for monitor in monitors], float).reshape(-1, 3)[:, :2]
        self._bias_rad = np.array([errors.bias_rad.get(monitor.id, 0.0) for monitor in monitors])
        self._errors = errors
        self._tracks = dict(tracks)
        self._rngs = dict(zip(tracks, rng.spawn(len(tracks)), strict=True))
        self.channels = {name: int(each.integers(bc.CHANNELS)) for name, each in self._rngs.items()}
        self._played_ns = 0
        self._waiting: list[Sent] = []

    def play(self, stop_ns: int) -> tuple[dict[int, list[Sent]], list[TrueBearing]]:
        """Play on until before `stop_ns`: reports sent meanwhile by monitor id, in order of sending, and the truth.

        The truth is that of the bearings measured meanwhile, in order of time; their reports may be sent later.
        """
        truth = [bearing for name in self._tracks for bearing in self._measured(name, self._played_ns, stop_ns)]
        self._played_ns = stop_ns
        sent: dict[int, list[Sent]] = {monitor.id: [] for monitor in self._monitors}
        self._waiting.sort(key=itemgetter(0))
        for each in self._waiting:
            if each[0] < stop_ns:
                sent[each[1].monitor_id].append(each)
        self._waiting = [each for each in self._waiting if each[0] >= stop_ns]
        return sent, sorted(truth, key=lambda bearing: bearing.stamp_ns)

    def _measured(self, name: str, start_ns: int, stop_ns: int) -> Iterator[TrueBearing]:
        """Bearings of one emitter from every monitor in range; the reports that are not lost wait to be sent."""
        phase_ns = self.channels[name] * bc.DWELL_NS
        rounds = range(-((phase_ns - start_ns) // bc.ROUND_NS), -((phase_ns - stop_ns) // bc.ROUND_NS))
        stamps = phase_ns + bc.ROUND_NS * np.array(rounds, np.int64)
        for stamp_ns, place_m in zip(stamps.tolist(), self._tracks[name](stamps)[:, :2], strict=True):
            yield from self._scan(name, stamp_ns, place_m)

    def _scan(self, name: str, stamp_ns: int, place_m: Array) -> Iterator[TrueBearing]:
        rng, count, errors = self._rngs[name], len(self._monitors), self._errors
        way_m = place_m - self._places_m
        distance_m = np.hypot(way_m[:, 0], way_m[:, 1])
        azimuth_rad = np.arctan2(way_m[:, 1], way_m[:, 0])
        error_rad = self._bias_rad + rng.normal(0.0, errors.noise_sd_rad, count)
        detuned_hz = rng.uniform(-1.0, 1.0, count) * bc.FREQUENCY_ACCURACY_HZ
        sent_ns = stamp_ns + rng.integers(0, errors.longest_delay_ns, count, endpoint=True)
        lost = rng.random(count) < errors.lost_share
        for i in np.flatnonzero(distance_m <= errors.detection_range_m).tolist():
            monitor_id, at_ns = self._monitors[i].id, None if lost[i] else int(sent_ns[i])
            truth = TrueBearing(
                stamp_ns,
                monitor_id,
                name,
                self.channels[name],
                float(azimuth_rad[i]),
                float(distance_m[i]),
                float(error_rad[i]),
                at_ns,
            )
            if at_ns is not None:
                self._waiting.append((at_ns, self._report(truth, float(detuned_hz[i]))))
            yield truth

    def _report(self, truth: TrueBearing, detuned_hz: float) -> BearingReport:
        middle_hz = bc.FIRST_CHANNEL_HZ + (truth.channel + 0.5) * bc.CHANNEL_SPACING_HZ + detuned_hz
        level_dbm = received_dbm(truth.distance_m, middle_hz)
        margin_db = level_dbm - received_dbm(self._errors.detection_range_m, middle_hz)
        surety = min(1.0, max(0.0, margin_db / bc.SURE_MARGIN_DB))
        return BearingReport(
            monitor_id=truth.monitor_id,
            stamp_ns=truth.stamp_ns,
            start_frequency_hz=middle_hz - bc.OCCUPIED_HZ / 2.0,
            stop_frequency_hz=middle_hz + bc.OCCUPIED_HZ / 2.0,
            frequency_count=1,
            dwell_time_s=bc.DWELL_NS / NS_PER_S,
            level_dbm=level_dbm,
            azimuth_rad=math.remainder(truth.azimuth_rad + truth.error_rad, math.tau),
            confidence=bc.LEAST_CONFIDENCE + (1.0 - bc.LEAST_CONFIDENCE) * surety,
        )


def received_dbm(distance_m: float, frequency_hz: float) -> float:
    """Level after `distance_m` of free space (Friis, isotropic aerials); nearer than 1 m as at 1 m."""
    spread = 4.0 * math.pi * max(distance_m, 1.0) * frequency_hz / _LIGHT_M_S
    return bc.TRANSMIT_POWER_DBM - 20.0 * math.log10(spread)
