"""The reports that count at present: admitted one by one, each refusal by its reason, and never more than a cap."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_coarse.settings import CoarseSettings
from mine_loc_core.stamps import to_ns

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_FIELDS = attrgetter(
    "monitor_id", "start_frequency_hz", "stop_frequency_hz", "frequency_count", "azimuth_rad", "confidence"
)
_LARGEST_YAW_RAD = math.pi + 1e-6
LAST_STAMP_NS = 2**62
"""Later stamps are refused: what is computed with stamps must stay within 64 bits."""


@dataclass(frozen=True, slots=True)
class Reports:
    """n bearings as columns: index of the monitor, stamp [ns], middle and width of the emission [Hz], yaw [rad]."""

    monitor: Indices
    stamp_ns: Indices
    middle_hz: Array
    width_hz: Array
    azimuth_rad: Array
    confidence: Array

    def __len__(self) -> int:
        return len(self.monitor)

    def taken(self, which: NDArray[np.bool_] | Indices) -> "Reports":
        """The reports that `which` picks."""
        return Reports(
            self.monitor[which],
            self.stamp_ns[which],
            self.middle_hz[which],
            self.width_hz[which],
            self.azimuth_rad[which],
            self.confidence[which],
        )

    def joined(self, other: "Reports") -> "Reports":
        """These and then the other ones."""
        return Reports(
            np.concatenate([self.monitor, other.monitor]),
            np.concatenate([self.stamp_ns, other.stamp_ns]),
            np.concatenate([self.middle_hz, other.middle_hz]),
            np.concatenate([self.width_hz, other.width_hz]),
            np.concatenate([self.azimuth_rad, other.azimuth_rad]),
            np.concatenate([self.confidence, other.confidence]),
        )


class OpenReports:
    """Reports of the last `window_s`, in whatever order they came; `refused` counts the others by reason.

    Reasons: unknown_monitor, frequency, azimuth, confidence, future, stale, duplicate, overflow (the oldest go when
    there are more than `cap`).
    """

    def __init__(self, monitor_ids: Sequence[int], settings: CoarseSettings, cap: int = 200_000) -> None:
        order = np.argsort(np.array(monitor_ids, np.int64))
        self._ids = np.array(monitor_ids, np.int64)[order]
        self._index = order
        self._window_ns = to_ns(settings.window_s)
        self._future_ns = to_ns(settings.future_s)
        self._cap = cap
        self.refused: Counter[str] = Counter()
        self.forget()

    def __len__(self) -> int:
        return len(self._open)

    def forget(self) -> None:
        """Drop all, as after a jump of the clock."""
        whole, real = np.zeros(0, np.int64), np.zeros(0)
        self._open = Reports(whole, whole, real, real, real, real)

    def add(self, reports: Sequence[BearingReport], now_ns: int) -> None:
        """Admit what makes sense at `now_ns`."""
        if not reports:
            return
        columns = np.array([_FIELDS(report) for report in reports], float)
        # Whole numbers that no clock shows would not fit the column; they are refused as future or stale below.
        stamps = [min(max(report.stamp_ns, -LAST_STAMP_NS), LAST_STAMP_NS) for report in reports]
        self._admit(columns, np.array(stamps, np.int64), now_ns)

    def current(self, now_ns: int) -> Reports:
        """The reports of the window that ends at `now_ns`; older ones are forgotten."""
        self._open = self._open.taken(now_ns - self._open.stamp_ns <= self._window_ns)
        return self._open

    def _admit(self, columns: Array, stamp_ns: Indices, now_ns: int) -> None:
        monitor_id, start_hz, stop_hz, count, azimuth_rad, confidence = columns.T
        place = np.minimum(np.searchsorted(self._ids, monitor_id), max(len(self._ids) - 1, 0))
        known = self._ids[place] == monitor_id if len(self._ids) else np.zeros(len(monitor_id), bool)
        checks = (
            ("unknown_monitor", known),
            ("frequency", (start_hz > 0.0) & (stop_hz >= start_hz) & (stop_hz < np.inf) & (count >= 1)),
            ("azimuth", np.abs(azimuth_rad) <= _LARGEST_YAW_RAD),
            ("confidence", (confidence >= 0.0) & (confidence <= 1.0)),
            ("future", stamp_ns <= now_ns + self._future_ns),
            ("stale", stamp_ns >= now_ns - self._window_ns),
        )
        good = np.ones(len(columns), bool)
        for reason, passed in checks:
            self._count(reason, good & ~passed)
            good &= passed
        if not good.any():
            return
        new = Reports(
            self._index[place[good]],
            stamp_ns[good],
            (start_hz[good] + stop_hz[good]) / 2.0,
            stop_hz[good] - start_hz[good],
            azimuth_rad[good],
            confidence[good],
        )
        first = self._first_of_its_kind(new)
        self._count("duplicate", ~first)
        self._open = self._open.joined(new if first.all() else new.taken(first))
        if len(self._open) > self._cap:
            oldest_first = np.argsort(self._open.stamp_ns, kind="stable")
            self.refused["overflow"] += len(self._open) - self._cap
            self._open = self._open.taken(oldest_first[-self._cap :])

    def _first_of_its_kind(self, new: Reports) -> NDArray[np.bool_]:
        keys = _keys(new)
        _, at = np.unique(keys, return_index=True)
        first = np.zeros(len(new), bool)
        first[at] = True
        if len(self._open):
            first &= ~np.isin(keys, _keys(self._open))
        return first

    def _count(self, reason: str, failed: NDArray[np.bool_]) -> None:
        if failed.any():
            self.refused[reason] += int(np.count_nonzero(failed))


def _keys(reports: Reports) -> NDArray[np.uint64]:
    """One number a report, the same for the same report: stamp, monitor, frequency and azimuth mixed (mod 2**64)."""
    mixed = reports.stamp_ns.view(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ reports.monitor.view(np.uint64)) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ reports.middle_hz.view(np.uint64)) * np.uint64(0x94D049BB133111EB)
    result: NDArray[np.uint64] = mixed ^ reports.azimuth_rad.view(np.uint64)
    return result
