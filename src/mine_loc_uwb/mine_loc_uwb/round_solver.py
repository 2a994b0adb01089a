"""From the ranges of a round to a position and a verdict on each range: checks, anchor map, solver."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mine_loc_core.site import Anchor
from mine_loc_core.verdicts import Reason, Source, Verdict
from mine_loc_uwb import least_squares
from mine_loc_uwb.fix import Fix, FixStatus
from mine_loc_uwb.parameters import UwbSolverParameters

_FROZEN_ROUNDS = 20
"""A radio's ranges scatter by 2 cm (hardware.md D.1); the same millimetre this often is a stuck value."""


@dataclass(frozen=True, slots=True)
class MeasuredRange:
    """One range as the driver published it, corrected for what the driver knows."""

    anchor_id: int
    range_m: float
    variance_m2: float


class RoundSolver:
    """Solves rounds of any number of tags against one anchor map."""

    def __init__(self, anchors: Iterable[Anchor], parameters: UwbSolverParameters) -> None:
        self.anchors: Mapping[int, Anchor] = {anchor.id: anchor for anchor in anchors}
        self.disabled: set[int] = set()
        self.parameters = parameters
        self._repeats: dict[tuple[int, int], tuple[float, int]] = {}

    def solve(
        self, tag_id: int, ranges: Sequence[MeasuredRange], height_m: float | None
    ) -> tuple[Fix, tuple[Verdict, ...]]:
        """Position of one tag (see `least_squares.solve`) and one verdict a range, in their order."""
        reasons: list[Reason] = []
        seen: set[int] = set()
        for item in ranges:
            reasons.append(Reason.DUPLICATE if item.anchor_id in seen else self._check(tag_id, item))
            if reasons[-1] is Reason.ACCEPTED:
                seen.add(item.anchor_id)
        used = [item for item, reason in zip(ranges, reasons, strict=True) if reason is Reason.ACCEPTED]
        anchors = [self.anchors[item.anchor_id] for item in used]
        variances = [item.variance_m2 for item in used if 0.0 < item.variance_m2 < math.inf]
        fix = least_squares.solve(
            np.array([anchor.position_m for anchor in anchors]).reshape(-1, 3),
            np.array([item.range_m - anchor.range_offset_m for item, anchor in zip(used, anchors, strict=True)]),
            range_sd_m=math.sqrt(np.mean(variances)) if variances else 0.1,
            height_m=height_m,
            max_gdop=self.parameters.max_gdop,
        )
        if fix.status is not FixStatus.OK:
            reasons = [Reason.DEGENERATE if reason is Reason.ACCEPTED else reason for reason in reasons]
        verdicts = tuple(
            Verdict(Source.RANGE, item.anchor_id, reason, innovation=self._residual(item, fix))
            for item, reason in zip(ranges, reasons, strict=True)
        )
        return fix, verdicts

    def forget(self, tag_id: int) -> None:
        """Release what is kept for a tag that went silent."""
        for key in [key for key in self._repeats if key[0] == tag_id]:
            del self._repeats[key]

    def _check(self, tag_id: int, item: MeasuredRange) -> Reason:
        anchor = self.anchors.get(item.anchor_id)
        if anchor is None:
            return Reason.UNKNOWN_SENSOR
        if item.anchor_id in self.disabled:
            return Reason.DISABLED
        corrected_m = item.range_m - anchor.range_offset_m
        if not math.isfinite(corrected_m) or corrected_m <= 0.0 or corrected_m > self.parameters.max_range_m:
            return Reason.INVALID
        last_m, repeats = self._repeats.get((tag_id, item.anchor_id), (math.nan, 0))
        repeats = repeats + 1 if item.range_m == last_m else 0
        self._repeats[tag_id, item.anchor_id] = item.range_m, repeats
        return Reason.FROZEN if repeats >= _FROZEN_ROUNDS else Reason.ACCEPTED

    def _residual(self, item: MeasuredRange, fix: Fix) -> float:
        anchor = self.anchors.get(item.anchor_id)
        if anchor is None:
            return math.nan
        return item.range_m - anchor.range_offset_m - math.dist(anchor.position_m, fix.position_m)
