"""Pairs of measured and true range, from which a correction is fitted."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Groups = npt.NDArray[np.int64]

_BLOCKS = 20


@dataclass(frozen=True, slots=True, eq=False)
class RangePairs:
    """Arrays (n,); ranges finite, `receive_power_dbm` NaN where not reported.

    `group` numbers what was measured at one place: its pairs share one error and are never parted between fitting and
    judging.
    """

    measured_m: Array
    true_m: Array
    nlos: Flags
    receive_power_dbm: Array
    group: Groups

    def __len__(self) -> int:
        return len(self.measured_m)

    def only(self, which: Flags) -> "RangePairs":
        """Those where `which` (n,)."""
        return RangePairs(
            self.measured_m[which],
            self.true_m[which],
            self.nlos[which],
            self.receive_power_dbm[which],
            self.group[which],
        )


def joined(parts: Sequence[RangePairs]) -> RangePairs:
    """All pairs, groups kept apart."""
    first = np.cumsum([0] + [int(part.group.max(initial=-1)) + 1 for part in parts])
    return RangePairs(
        np.concatenate([part.measured_m for part in parts]),
        np.concatenate([part.true_m for part in parts]),
        np.concatenate([part.nlos for part in parts]),
        np.concatenate([part.receive_power_dbm for part in parts]),
        np.concatenate([part.group + start for part, start in zip(parts, first[:-1], strict=True)]),
    )


def groups_by_distance(true_m: Array) -> Groups:
    """Groups of pairs (n,) that name none: one a true distance where these repeat, else blocks of neighbouring rows."""
    places, group = np.unique(np.round(true_m, 2), return_inverse=True)
    if 3 <= len(places) <= len(true_m) // 2:
        return np.asarray(group, np.int64)
    return np.arange(len(true_m)) * min(_BLOCKS, len(true_m)) // max(len(true_m), 1)
