"""Crossing of bearings: where two of them meet, how sure that is, and which meetings do not count (paper E, step 3)."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_RANGE_MARGIN_SD = 3.0
LEAST_MARGIN, LARGEST_MARGIN = 0.02, 0.2
"""A crossing beyond the detection range counts as far as its own error explains it, within these shares of the range:
the range ends nowhere sharply, and what is farther than the largest is no place to look for anybody."""


@dataclass(frozen=True, slots=True)
class Crossings:
    """n crossings of the lines `first` and `second`: positions (n, 2) [m], covariances (n, 2, 2) [m²].

    `refused` counts those that do not count: parallel, behind, out_of_range.
    """

    first: Indices
    second: Indices
    position_m: Array
    covariance_m2: Array
    refused: Counter[str]

    def __len__(self) -> int:
        return len(self.first)

    def taken(self, which: NDArray[np.bool_] | Indices) -> "Crossings":
        """The crossings that `which` picks."""
        return Crossings(
            self.first[which], self.second[which], self.position_m[which], self.covariance_m2[which], self.refused
        )


def pairs_within(group: Indices) -> tuple[Indices, Indices]:
    """All pairs (i, j), i < j, of equal `group`, which is sorted."""
    ends = np.searchsorted(group, group, side="right")
    partners = ends - np.arange(len(group)) - 1
    first = np.repeat(np.arange(len(group)), partners)
    before = np.cumsum(partners) - partners
    return first, np.arange(len(first)) - before[first] + first + 1


def cross(
    place_m: Array, azimuth_rad: Array, variance_rad2: Array, first: Indices, second: Indices, range_m: float
) -> Crossings:
    """Cross the lines from `place_m` (k, 2) with yaws `azimuth_rad` (k,), in pairs `first`, `second` (n,).

    Paper E, equations of step 3: with compass azimuths α and a baseline of length L at angle β from east,

        R_i = L cos(α_j + β) / sin(α_i − α_j),  R_j = L cos(α_i + β) / sin(α_i − α_j),

    (the print has the denominators' sign reversed), which in ENU yaw are the cross products below. An error dα_i moves
    the crossing along line j by R_i dα_i / sin(α_i − α_j): the covariance to first order. Nearly collinear lines are
    kept, with the long covariance that they have.
    """
    along = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)], axis=1)
    u_i, u_j = along[first], along[second]
    baseline_m = place_m[second] - place_m[first]
    sine = u_i[:, 0] * u_j[:, 1] - u_i[:, 1] * u_j[:, 0]
    crosses = sine != 0.0
    inverse = 1.0 / np.where(crosses, sine, 1.0)
    r_i = (baseline_m[:, 0] * u_j[:, 1] - baseline_m[:, 1] * u_j[:, 0]) * inverse
    r_j = (baseline_m[:, 0] * u_i[:, 1] - baseline_m[:, 1] * u_i[:, 0]) * inverse
    a = np.abs(r_j * inverse) * np.sqrt(variance_rad2[second])  # along line i, by the error of line j
    b = np.abs(r_i * inverse) * np.sqrt(variance_rad2[first])
    least, largest = LEAST_MARGIN * range_m, LARGEST_MARGIN * range_m
    far_i = r_i > range_m + np.minimum(least + _RANGE_MARGIN_SD * a, largest)
    far_j = r_j > range_m + np.minimum(least + _RANGE_MARGIN_SD * b, largest)
    refused: Counter[str] = Counter()
    good = np.ones(len(first), bool)
    for reason, failed in (
        ("parallel", ~crosses),
        ("behind", (r_i <= 0.0) | (r_j <= 0.0)),
        ("out_of_range", far_i | far_j),
    ):
        refused[reason] += int(np.count_nonzero(good & failed))
        good &= ~failed
    kept = np.flatnonzero(good)
    along_i, along_j = u_i[kept] * a[kept, None], u_j[kept] * b[kept, None]
    covariance = along_i[:, :, None] * along_i[:, None, :] + along_j[:, :, None] * along_j[:, None, :]
    return Crossings(
        first[kept], second[kept], place_m[first[kept]] + r_i[kept, None] * u_i[kept], covariance, +refused
    )
