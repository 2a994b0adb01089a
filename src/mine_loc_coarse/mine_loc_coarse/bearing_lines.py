"""Bearing lines: the reports of one monitor that are of one emitter, over the window, as one bearing.

A monitor that reports an emission twice in one scan hears two emitters on the channel, so the most reports of a scan
say how many lines there are. Averages of a window are much sharper than single bearings, and it is they that are
crossed: with twelve reports of 2° a ghost stands out at 0.6°.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from mine_loc_coarse.open_reports import Reports

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]
_APART_SD = 5.0
"""Neighbouring azimuths of one emitter at one monitor are not farther apart than so many standard deviations."""
_SPLIT_ROUNDS = 5
_MOST_AT_ONCE = 16
"""More emitters at once on one channel are not told apart at one monitor: each report is a line, a crowd."""


@dataclass(frozen=True, slots=True)
class BearingLines:
    """n lines in order of emission, then monitor: yaw [rad], its variance [rad²], number of reports."""

    emission: Indices
    monitor: Indices
    azimuth_rad: Array
    variance_rad2: Array
    count: Indices

    def __len__(self) -> int:
        return len(self.emission)


def bearing_lines(
    reports: Reports, emission: Indices, azimuth_sd_rad: float, scan_ns: int
) -> tuple[BearingLines, Indices]:
    """Lines of `reports` (n,) with their `emission` (n,), and the line of each report (n,)."""
    order = np.lexsort((reports.stamp_ns, reports.monitor, emission))
    stamp_ns, azimuth_rad = reports.stamp_ns[order], reports.azimuth_rad[order]
    group_emission, group_monitor = emission[order], reports.monitor[order]
    begins = np.ones(len(order), bool)
    begins[1:] = (np.diff(group_emission) != 0) | (np.diff(group_monitor) != 0)
    group = np.cumsum(begins) - 1
    line = group.copy()
    scan = np.cumsum(begins | (np.diff(stamp_ns, prepend=stamp_ns[:1]) > scan_ns)) - 1
    limit_rad = _APART_SD * azimuth_sd_rad
    extra = 0
    for each in _unclear_groups(group, begins, scan, azimuth_rad, limit_rad):
        rows = np.flatnonzero(group == each)
        split = _split(azimuth_rad[rows], scan[rows], limit_rad)
        line[rows] = np.where(split == 0, each, group[-1] + extra + split)
        extra += int(split.max())
    lines, line = _summed_up(line, group_emission, group_monitor, azimuth_rad, azimuth_sd_rad)
    of_report = np.empty(len(order), np.int64)
    of_report[order] = line
    return lines, of_report


def _unclear_groups(group: Indices, begins: Flags, scan: Indices, azimuth_rad: Array, limit_rad: float) -> list[int]:
    """Groups with two reports in a scan, or azimuths too far from each other for one emitter that stands."""
    starts = np.flatnonzero(begins)
    off_rad = _wrapped(azimuth_rad - azimuth_rad[starts][group])
    spread_rad = np.maximum.reduceat(off_rad, starts) - np.minimum.reduceat(off_rad, starts)
    unclear = spread_rad > limit_rad
    unclear[group[1:][np.diff(scan) == 0]] = True
    return [int(each) for each in np.flatnonzero(unclear)]


def _split(azimuth_rad: Array, scan: Indices, limit_rad: float) -> Indices:
    """Number of the line, from 0, of each report of one monitor and emission."""
    order = np.argsort(azimuth_rad)
    gaps = np.diff(azimuth_rad[order], append=azimuth_rad[order[0]] + 2.0 * np.pi)
    # The circle is cut open at its widest gap.
    cut = int(np.argmax(gaps)) + 1
    order, gaps = np.roll(order, -cut), np.roll(gaps, -cut)
    run = np.empty(len(order), np.int64)
    run[order] = np.concatenate([[0], np.cumsum(gaps[:-1] > limit_rad)])
    line = np.zeros(len(order), np.int64)
    lines = 0
    for each in range(int(run.max()) + 1):
        rows = np.flatnonzero(run == each)
        line[rows] = lines + _shared_out(azimuth_rad[rows], scan[rows])
        lines = int(line[rows].max()) + 1
    return line


def _shared_out(azimuth_rad: Array, scan: Indices) -> Indices:
    """Share the reports of a run among as many lines as the fullest scan has reports, in order of azimuth."""
    scans = [np.flatnonzero(scan == each) for each in np.unique(scan)]
    many = max(len(rows) for rows in scans)
    line = np.zeros(len(azimuth_rad), np.int64)
    if many == 1:
        return line
    if many > _MOST_AT_ONCE:
        return np.arange(len(line))
    off_rad = _wrapped(azimuth_rad - azimuth_rad[0])
    full = [np.sort(off_rad[rows]) for rows in scans if len(rows) == many]
    centre_rad = np.mean(full, axis=0)
    for _ in range(_SPLIT_ROUNDS):
        for rows in scans:
            here, there = linear_sum_assignment((off_rad[rows][:, None] - centre_rad) ** 2)
            line[rows[here]] = there
        centre_rad = np.sort([off_rad[line == each].mean() for each in range(many)])
    return line


def _summed_up(
    line: Indices, emission: Indices, monitor: Indices, azimuth_rad: Array, sd_rad: float
) -> tuple[BearingLines, Indices]:
    """The lines in order of emission and monitor, and the reports' numbers among them."""
    numbers, first, count = np.unique(line, return_index=True, return_counts=True)
    rank = np.lexsort((numbers, monitor[first], emission[first]))
    place = np.empty(numbers[-1] + 1 if len(numbers) else 0, np.int64)
    place[numbers[rank]] = np.arange(len(rank))
    line, first, count = place[line], first[rank], count[rank]
    reference_rad = azimuth_rad[first]
    off_rad = _wrapped(azimuth_rad - reference_rad[line])
    mean_rad = np.bincount(line, off_rad, len(count)) / count
    scatter = np.bincount(line, (off_rad - mean_rad[line]) ** 2, len(count)) / np.maximum(count - 1, 1)
    # An emitter near a monitor sweeps through angles: its scatter, not the noise alone, says how sharp the mean is.
    variance = np.maximum(sd_rad**2, np.where(count > 2, scatter, 0.0)) / count
    lines = BearingLines(emission[first], monitor[first], _wrapped(reference_rad + mean_rad), variance, count)
    return lines, line


def _wrapped(angle_rad: Array) -> Array:
    wrapped: Array = (angle_rad + np.pi) % (2.0 * np.pi) - np.pi
    return wrapped
