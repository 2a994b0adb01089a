"""Coarse positioning of paper E, whole: reports in, situations out."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_coarse.emissions import emissions
from mine_loc_coarse.emitter_fit import Bearings, Fits, bearings_of, fit
from mine_loc_coarse.locator import Emitters, Expected, Locator
from mine_loc_coarse.monitor_bias import MonitorBias
from mine_loc_coarse.open_reports import OpenReports, Reports
from mine_loc_coarse.settings import CoarseSettings
from mine_loc_coarse.sighting import Sighting
from mine_loc_coarse.situation import Situation, situation_of
from mine_loc_coarse.tracks import Status, Tracks
from mine_loc_core.site import Gallery, Monitor
from mine_loc_core.stamps import to_ns

Array = NDArray[np.float64]
_SPEED_SD = 0.5**0.5
"""Of a walker's velocity on one axis, over the root mean square of the speed."""
_BIAS_MATTERS = 0.02
"""A change of a bias by less than this share of the noise is not worth another fit."""


class CoarsePositioning:
    """Positions emitters by the bearings of `monitors`; knows no clock, so the caller says what time it is."""

    def __init__(
        self, monitors: Sequence[Monitor], settings: CoarseSettings, galleries: Sequence[Gallery] = ()
    ) -> None:
        self._settings = settings
        self._galleries = tuple(galleries)
        self._ids = [monitor.id for monitor in monitors]
        self._place_m = np.array([monitor.position_m[:2] for monitor in monitors], float).reshape(-1, 2)
        self._reports = OpenReports(self._ids, settings)
        self._locator = Locator(self._place_m, settings)
        self._bias = MonitorBias(len(monitors), settings.azimuth_sd_rad)
        self._tracks = Tracks(settings)

    @property
    def figures(self) -> Mapping[str, int]:
        """Counters for diagnostics: what was refused, by reason, and how full it is."""
        return {
            "open_reports": len(self._reports),
            "tracks": len(self._tracks.tracks),
            "track_overflow": self._tracks.overflow,
            "crossings": self._locator.crossings,
            "crowded_channels": self._locator.crowded,
            **{f"crossing_{reason}": count for reason, count in self._locator.refused.items()},
        }

    @property
    def refused(self) -> Mapping[str, int]:
        """Reports that were refused, by reason."""
        return self._reports.refused

    @property
    def bias_rad(self) -> Mapping[int, float]:
        """The constant bearing error taken off each monitor."""
        return dict(zip(self._ids, self._bias.mean_rad.tolist(), strict=True))

    def forget(self) -> None:
        """Forget what rests on stamps, after a jump of the clock; monitors keep their bias."""
        self._reports.forget()
        self._tracks.forget()

    def add(self, reports: Sequence[BearingReport], now_ns: int) -> None:
        """Take reports, in any order."""
        self._reports.add(reports, now_ns)

    def situation(self, now_ns: int) -> Situation:
        """The situation at `now_ns` by the reports of the window."""
        s = self._settings
        reports = self._bias.corrected(self._reports.current(now_ns))
        emission = emissions(reports, s.frequency_accuracy_hz)
        emission_hz = _means(reports.middle_hz, emission)
        emitters = self._locator.locate(reports, emission, self._expected(emission_hz, now_ns))
        sightings = self._sightings(reports, emitters, emission_hz, now_ns)
        spare = np.ones(len(reports), bool)
        spare[emitters.report] = False
        tracks = self._tracks.update(sightings, emission_hz, set(emission[spare].tolist()), now_ns)
        return situation_of(tracks, now_ns, s.region_probability, s.communication_range_m, self._ids, self._galleries)

    def _expected(self, emission_hz: Array, now_ns: int) -> list[Expected]:
        """Emitters that were stated before the window began: what the window's reports did not decide themselves."""
        begin_ns = now_ns - to_ns(self._settings.window_s)
        old = [
            track
            for track in self._tracks.tracks
            if track.stated_ns is not None and track.stated_ns < begin_ns and track.status is not Status.LOST
        ]
        return [
            Expected(
                int(np.argmin(np.abs(emission_hz - track.sighting.frequency_hz))),
                track.state[:2],
                track.covariance[:2, :2],
            )
            for track in old
            if len(emission_hz)
        ]

    def _sightings(self, reports: Reports, emitters: Emitters, emission_hz: Array, now_ns: int) -> list[Sighting]:
        s = self._settings
        count = len(emitters.emission)
        if not count:
            return []
        bearings = bearings_of(reports, emitters.report, emitters.emitter, self._place_m, now_ns)
        speed = s.speed_m_s * _SPEED_SD
        fits = fit(bearings, emitters.position_m, s.azimuth_sd_rad, s.detection_range_m, speed)
        before_rad = self._bias.mean_rad
        self._bias.learn(*_stated(bearings, fits, emitters.stated), now_ns, to_ns(s.window_s))
        change_rad = self._bias.mean_rad - before_rad
        if np.any(np.abs(change_rad) > _BIAS_MATTERS * s.azimuth_sd_rad):
            bearings = replace(bearings, azimuth_rad=bearings.azimuth_rad - change_rad[bearings.monitor])
            fits = fit(bearings, fits.state[:, :2], s.azimuth_sd_rad, s.detection_range_m, speed)
        heard = np.zeros((count, len(self._ids)), bool)
        heard[bearings.emitter, bearings.monitor] = True
        last_ns = np.zeros(count, np.int64)
        np.maximum.at(last_ns, bearings.emitter, reports.stamp_ns[emitters.report])
        doubt = np.log1p(-np.minimum(reports.confidence[emitters.report], 1.0 - 1e-6))
        existing = emitters.probability * -np.expm1(np.bincount(bearings.emitter, doubt, count))
        monitors = [tuple(np.flatnonzero(row).tolist()) for row in heard]
        return [
            Sighting(
                emission,
                float(emission_hz[emission]),
                fits.state[k],
                fits.covariance[k],
                float(existing[k]),
                bool(emitters.stated[k]),
                monitors[k],
                int(last_ns[k]),
            )
            for k, emission in enumerate(emitters.emission.tolist())
        ]


def _stated(bearings: Bearings, fits: Fits, stated: NDArray[np.bool_]) -> tuple[Bearings, Fits]:
    """The bearings of stated emitters alone: the rivals of an ambiguous pairing teach nothing."""
    if stated.all():
        return bearings, fits
    rank, own = np.cumsum(stated) - 1, stated[bearings.emitter]
    kept = Bearings(
        rank[bearings.emitter[own]],
        bearings.monitor[own],
        bearings.place_m[own],
        bearings.age_s[own],
        bearings.azimuth_rad[own],
    )
    return kept, Fits(fits.state[stated], fits.covariance[stated], fits.residual_rad[own], fits.jacobian[own])


def _means(values: Array, group: NDArray[np.int64]) -> Array:
    if not len(values):
        return np.zeros(0)
    means: Array = np.bincount(group, values) / np.bincount(group)
    return means
