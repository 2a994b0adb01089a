"""From the open reports of a window to emitters: association, crossing, clustering, confirmation, fit (paper E)."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from mine_loc_coarse.bearing_lines import BearingLines, bearing_lines
from mine_loc_coarse.coverage import Coverage
from mine_loc_coarse.crossing import LARGEST_MARGIN, Crossings, cross, pairs_within
from mine_loc_coarse.crossing_clusters import clusters
from mine_loc_coarse.open_reports import Reports
from mine_loc_coarse.pairing import Line, Pairer, Pairing
from mine_loc_coarse.settings import CoarseSettings
from mine_loc_core.stamps import to_ns

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]
_CROWD_LINES = 32
_GRID = 100
_SILENCE_EXPLAINED = 0.2
"""Below this probability of the silence of other monitors, a pairing is weighed against its rivals."""


@dataclass(frozen=True, slots=True)
class Emitters:
    """k emitters: emission (k,), rough position (k, 2) [m], probability (k,), whether `stated` (k,) or ambiguous.

    Report `report[p]` is of emitter `emitter[p]`; rivals of an ambiguous pairing share reports, others do not.
    """

    emission: Indices
    position_m: Array
    probability: Array
    stated: Flags
    report: Indices
    emitter: Indices


@dataclass(frozen=True, slots=True)
class Expected:
    """An emitter stated before this window began: the emission, where it should be now (2,), and covariance (2, 2)."""

    emission: int
    position_m: Array
    covariance_m2: Array


class Locator:
    """Finds the emitters in the reports of a window. `place_m` (m, 2) are the monitors.

    After each call `crossings` is the number of crossings that counted, `refused` how many did not and why, and
    `crowded` the number of channels with more bearings than can be told apart.
    """

    def __init__(self, place_m: Array, settings: CoarseSettings) -> None:
        self._place_m = place_m
        self._settings = settings
        self._coverage = Coverage(place_m, settings.detection_range_m, settings.heard_share)
        self._pairer = Pairer(self._coverage, settings.stated_probability)
        self._area_m2 = covered_area_m2(place_m, settings.detection_range_m)
        reach_m = 2.0 * (1.0 + LARGEST_MARGIN) * settings.detection_range_m
        self._meet = np.hypot(*(place_m[:, None] - place_m).transpose(2, 0, 1)) <= reach_m
        np.fill_diagonal(self._meet, val=False)
        self.crossings = self.crowded = 0
        self.refused: Counter[str] = Counter()

    def locate(self, reports: Reports, emission: Indices, expected: Sequence[Expected]) -> Emitters:
        """The emitters of `reports` (n,), whose emissions are `emission` (n,)."""
        s = self._settings
        lines, line_of_report = bearing_lines(reports, emission, s.azimuth_sd_rad, to_ns(s.scan_s))
        first, second = pairs_within(self._uncrowded(lines))
        meet = self._meet[lines.monitor[first], lines.monitor[second]]
        crossings = cross(
            self._place_m[lines.monitor],
            lines.azimuth_rad,
            lines.variance_rad2,
            first[meet],
            second[meet],
            s.detection_range_m,
        )
        self.crossings, self.refused = len(crossings), crossings.refused
        part = _parts(crossings, len(lines))
        crossings = crossings.taken(np.argsort(part[crossings.first], kind="stable"))
        on = part[crossings.first]
        cluster = clusters(crossings.position_m, crossings.covariance_m2, on)
        gathered = _Gathering(lines)
        clear = self._clear(lines, crossings, cluster, part)
        self._take_clear(gathered, lines, crossings, part, clear)
        for each in np.setdiff1d(on, np.flatnonzero(clear)).tolist():
            self._weigh(gathered, lines, crossings.taken(on == each), expected)
        return gathered.emitters(line_of_report)

    def _uncrowded(self, lines: BearingLines) -> Indices:
        """The emission of each line, but a group of its own for each line of a crowd, which is then not crossed."""
        many = np.bincount(lines.emission, minlength=1)
        crowd = (many > _CROWD_LINES)[lines.emission]
        self.crowded = int(np.count_nonzero(many > _CROWD_LINES))
        if not crowd.any():
            return lines.emission
        return np.cumsum(crowd | (np.diff(lines.emission, prepend=-1) != 0))

    def _clear(self, lines: BearingLines, crossings: Crossings, cluster: Indices, part: Indices) -> Flags:
        """Parts (p,) that one emitter explains: one cluster of crossings, and one line a monitor."""
        count = int(part.max()) + 1 if len(part) else 0
        total = np.bincount(part, minlength=count)
        pairs = np.unique(part * len(self._place_m) + lines.monitor)
        distinct = np.bincount(pairs // len(self._place_m), minlength=count)
        _, one_of_each = np.unique(cluster, return_index=True)
        many = np.bincount(part[crossings.first[one_of_each]], minlength=count)
        clear: Flags = (many == 1) & (total == distinct)
        return clear

    def _take_clear(
        self, gathered: "_Gathering", lines: BearingLines, crossings: Crossings, part: Indices, clear: Flags
    ) -> None:
        """State the clear parts, if it is no wonder that the other monitors are silent; else they are clear no more."""
        numbers = np.flatnonzero(clear)
        if not len(numbers):
            return
        on = part[crossings.first]
        weight = 1.0 / np.trace(crossings.covariance_m2, axis1=1, axis2=2)
        total = np.bincount(on, weight, len(clear))[numbers]
        x, y = (np.bincount(on, weight * crossings.position_m[:, axis], len(clear))[numbers] / total for axis in (0, 1))
        position_m = np.stack([x, y], axis=1)
        scans = np.zeros(len(clear))
        np.maximum.at(scans, part, lines.count)
        missed = self._coverage.missed(position_m, scans[numbers], np.sqrt(1.0 / total))
        rank = np.searchsorted(numbers, part)
        own = clear[part]
        missed[rank[own], lines.monitor[own]] = 1.0
        plain = missed.prod(axis=1) >= _SILENCE_EXPLAINED
        clear[numbers[~plain]] = False
        gathered.take_whole(part, numbers[plain], position_m[plain])

    def _weigh(
        self, gathered: "_Gathering", lines: BearingLines, crossings: Crossings, expected: Sequence[Expected]
    ) -> None:
        """Weigh the pairings of one part."""
        first, second = crossings.first.tolist(), crossings.second.tolist()
        members = [_line(lines, number) for number in sorted({*first, *second})]
        meetings = [*zip(first, second, map(tuple, crossings.position_m.tolist()), strict=True)]
        emission = lines.emission[first[0]]
        known = [
            (tuple(each.position_m.tolist()), upper(each.covariance_m2))
            for each in expected
            if each.emission == emission
        ]
        density = (int(lines.emission[-1]) + 1) / (self._settings.channels * self._area_m2)
        gathered.take_pairing(self._pairer.pair(members, meetings, density, known))


def _parts(crossings: Crossings, lines: int) -> Indices:
    """Number of the part of each line: lines that crossings connect, directly or by others."""
    edges = (np.ones(len(crossings), bool), (crossings.first, crossings.second))
    part: Indices = connected_components(coo_array(edges, shape=(lines, lines)), directed=False)[1].astype(np.int64)
    return part


class _Gathering:
    """Emitters as they are found: their lines, and then the reports of these."""

    def __init__(self, lines: BearingLines) -> None:
        self._lines = lines
        self._emission: list[int] = []
        self._position_m: list[Array] = []
        self._probability: list[float] = []
        self._stated: list[bool] = []
        self._line: list[Indices] = []
        self._emitter: list[Indices] = []

    def take_whole(self, part: Indices, numbers: Indices, position_m: Array) -> None:
        """Take parts `numbers` (k,) with all their lines, each for one emitter at `position_m` (k, 2)."""
        own = np.flatnonzero(np.isin(part, numbers))
        rank = np.searchsorted(numbers, part[own])
        emission = np.zeros(len(numbers), np.int64)
        emission[rank] = self._lines.emission[own]
        self._line.append(own)
        self._emitter.append(rank + len(self._emission))
        self._emission += emission.tolist()
        self._position_m += [*position_m]
        self._probability += [1.0] * len(numbers)
        self._stated += [True] * len(numbers)

    def take_pairing(self, pairing: Pairing) -> None:
        """Take what was weighed on one channel."""
        for stated, candidates in ((True, pairing.stated), (False, pairing.ambiguous)):
            for candidate in candidates:
                own = np.array(sorted(candidate.lines), np.int64)
                self._line.append(own)
                self._emitter.append(np.full(len(own), len(self._emission)))
                self._emission.append(int(self._lines.emission[own[0]]))
                self._position_m.append(np.array(candidate.position_m))
                self._probability.append(candidate.probability)
                self._stated.append(stated)

    def emitters(self, line_of_report: Indices) -> Emitters:
        """All that was taken, with the reports of each."""
        line = np.concatenate([*self._line, np.zeros(0, np.int64)])
        emitter = np.concatenate([*self._emitter, np.zeros(0, np.int64)])
        order = np.argsort(line_of_report, kind="stable")
        starts = np.searchsorted(line_of_report[order], line)
        counts = self._lines.count[line]
        within = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
        return Emitters(
            np.array(self._emission, np.int64),
            np.array(self._position_m).reshape(-1, 2),
            np.array(self._probability),
            np.array(self._stated, bool),
            order[np.repeat(starts, counts) + within],
            np.repeat(emitter, counts),
        )


def covered_area_m2(place_m: Array, range_m: float) -> float:
    """Area within `range_m` of a monitor, to a percent or so: counted on a grid."""
    if not len(place_m):
        return 1.0
    low, high = place_m.min(axis=0) - range_m, place_m.max(axis=0) + range_m
    axes = [np.linspace(low[axis], high[axis], _GRID) for axis in (0, 1)]
    grid = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    near = np.zeros(len(grid), bool)
    for place in place_m:
        near |= np.hypot(*(grid - place).T) <= range_m
    return float(np.mean(near) * np.prod(high - low))


def upper(covariance_m2: Array) -> tuple[float, float, float]:
    """The three different elements of a covariance (2, 2)."""
    return float(covariance_m2[0, 0]), float(covariance_m2[0, 1]), float(covariance_m2[1, 1])


def _line(lines: BearingLines, number: int) -> Line:
    return Line(
        number,
        int(lines.monitor[number]),
        float(lines.azimuth_rad[number]),
        float(lines.variance_rad2[number]),
        int(lines.count[number]),
    )
