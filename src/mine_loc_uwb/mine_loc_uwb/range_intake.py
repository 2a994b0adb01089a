"""What a tag measured, checked and corrected against the anchor map: the one intake of all that use ranges."""

import math
from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mine_loc_core.site import Anchor
from mine_loc_core.stamps import NS_PER_S
from mine_loc_core.verdicts import Reason, Source
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.range_checks import RepeatedValues, impossible
from mine_loc_uwb.range_correction import RangeCorrection
from mine_loc_uwb.received_power import odds_of_power_rule, uncompress_dbm

MOST_TAGS = 4096
_DEFAULT_VARIANCE_M2, _LEAST_VARIANCE_M2, _MOST_VARIANCE_M2 = 0.1**2, 0.001**2, 1000.0**2
_LEAST_RANGE_M = 1e-3
_NO_LEVEL_DBM = 200.0
_PRF_MHZ = 64
"""Levels are taken for those of radios at this pulse repetition frequency, which messages do not tell."""
_LINK_STATE_HOLDS_NS = NS_PER_S
"""A walker passes what obstructs a link in about this time."""
_LONGEST_ROUND_NS = NS_PER_S


@dataclass(frozen=True, slots=True)
class MeasuredRange:
    """One range, or one arrival of a blink as a way, as the driver published it."""

    anchor_id: int
    range_m: float
    variance_m2: float
    since_ns: int = 0
    """Instant of the exchange minus the stamp of the round."""
    los_probability: float = math.nan
    receive_power_dbm: float = math.nan


class RangeIntake:
    """Intake of any number of tags against one anchor map; ranges of an anchor in `disabled` are refused."""

    def __init__(
        self, anchors: Iterable[Anchor], max_range_m: float, correction: RangeCorrection | None = None
    ) -> None:
        self.anchors: Mapping[int, Anchor] = {anchor.id: anchor for anchor in anchors}
        self.disabled: set[int] = set()
        self.max_range_m = max_range_m
        self._correction = correction or RangeCorrection()
        self._repeated: OrderedDict[tuple[int, Source], RepeatedValues] = OrderedDict()
        self._link_states: OrderedDict[int, dict[int, tuple[float, int]]] = OrderedDict()

    def take(
        self, tag_id: int, stamp_ns: int, items: Sequence[MeasuredRange], height_m: float | None, source: Source
    ) -> tuple[Measurements, list[Reason]]:
        """The measurements that are good, and of every item whether it is (ACCEPTED) or why not.

        `source` is RANGE, or TDOA for the arrivals of a blink (see `Measurements`).
        """
        reasons = self._checked(self._repeated_of(tag_id, source), items, source)
        used = [item for item, reason in zip(items, reasons, strict=True) if reason is Reason.ACCEPTED]
        return self._measurements(tag_id, stamp_ns, used, height_m, source), reasons

    def link_state(self, tag_id: int, anchor_id: int, stamp_ns: int, los_probability: float) -> None:
        """A judgement of the classifier; counts before the powers' for the link's measurements of the next second."""
        if anchor_id not in self.anchors:
            return
        self._link_states.setdefault(tag_id, {})[anchor_id] = los_probability, stamp_ns
        self._link_states.move_to_end(tag_id)
        if len(self._link_states) > MOST_TAGS:
            self._link_states.popitem(last=False)

    def reset(self) -> None:
        """Forget what rests on earlier stamps."""
        self._repeated.clear()
        self._link_states.clear()

    def forget(self, tag_id: int) -> None:
        """Release what is kept for a tag that went silent."""
        self._link_states.pop(tag_id, None)
        for source in (Source.RANGE, Source.TDOA):
            self._repeated.pop((tag_id, source), None)

    def _repeated_of(self, tag_id: int, source: Source) -> RepeatedValues:
        """The tag heard longest ago makes room when there are too many."""
        key = tag_id, source
        if key not in self._repeated and len(self._repeated) >= MOST_TAGS:
            self._repeated.popitem(last=False)
        repeated = self._repeated.setdefault(key, RepeatedValues())
        self._repeated.move_to_end(key)
        return repeated

    def _checked(self, repeated: RepeatedValues, items: Sequence[MeasuredRange], source: Source) -> list[Reason]:
        """What is refused before the solver; a failed range does not make the next one of its anchor a duplicate."""
        reasons: list[Reason] = []
        seen: set[int] = set()
        for item in items:
            reason = Reason.DUPLICATE if item.anchor_id in seen else self._check(repeated, item, source)
            if reason is Reason.ACCEPTED:
                seen.add(item.anchor_id)
            reasons.append(reason)
        return reasons

    def _check(self, repeated: RepeatedValues, item: MeasuredRange, source: Source) -> Reason:
        anchor = self.anchors.get(item.anchor_id)
        if anchor is None:
            return Reason.UNKNOWN_SENSOR
        if item.anchor_id in self.disabled:
            return Reason.DISABLED
        difference = source is Source.TDOA
        value_m = item.range_m if difference else item.range_m - anchor.range_offset_m
        if impossible(value_m, self.max_range_m, difference=difference):
            return Reason.INVALID
        if abs(item.since_ns) > _LONGEST_ROUND_NS:
            return Reason.INVALID
        reference = difference and item.range_m == 0.0
        if not reference and repeated.frozen(item.anchor_id, item.range_m):
            return Reason.FROZEN
        return Reason.ACCEPTED

    def _measurements(
        self, tag_id: int, stamp_ns: int, items: Sequence[MeasuredRange], height_m: float | None, source: Source
    ) -> Measurements:
        anchors = [self.anchors[item.anchor_id] for item in items]
        judged = np.array([self._judgement(tag_id, stamp_ns, item) for item in items], float).reshape(-1, 2)
        power_dbm = np.array([item.receive_power_dbm for item in items], float)
        power_dbm[~(np.abs(power_dbm) < _NO_LEVEL_DBM)] = math.nan
        range_m = np.array([item.range_m for item in items], float)
        variance_m2 = np.array([_variance(item, anchor) for item, anchor in zip(items, anchors, strict=True)], float)
        if source is Source.RANGE:
            offset_m = np.array([anchor.range_offset_m for anchor in anchors], float)
            found = self._correction.correct(range_m, power_dbm, 1.0 - judged[:, 0], offset_m)
            range_m, variance_m2 = np.maximum(found.range_m, _LEAST_RANGE_M), variance_m2 + found.added_variance_m2
        return Measurements(
            stamp_ns=stamp_ns,
            anchor_ids=np.array([item.anchor_id for item in items], np.uint64),
            anchors_m=np.array([anchor.position_m for anchor in anchors]).reshape(-1, 3),
            range_m=range_m,
            variance_m2=variance_m2,
            since_s=np.array([item.since_ns / NS_PER_S for item in items], float) - self._correction.stamp_latency_s,
            los_probability=judged[:, 1].copy(),
            receive_power_dbm=uncompress_dbm(power_dbm, _PRF_MHZ),
            height_m=height_m,
            shared_offset=source is Source.TDOA,
        )

    def _judgement(self, tag_id: int, stamp_ns: int, item: MeasuredRange) -> tuple[float, float]:
        """LOS probability as it was told, and what that is worth at even odds: the classifier's, else the powers'."""
        told, told_ns = self._link_states.get(tag_id, {}).get(item.anchor_id, (math.nan, 0))
        if 0.0 <= told <= 1.0 and abs(stamp_ns - told_ns) <= _LINK_STATE_HOLDS_NS:
            return told, told
        rule = item.los_probability if 0.0 <= item.los_probability <= 1.0 else math.nan
        return rule, odds_of_power_rule(rule)


def _variance(item: MeasuredRange, anchor: Anchor) -> float:
    """Of the range and of where the anchor hangs, within what a radio can mean; what it cannot counts as unknown."""
    claimed = item.variance_m2 if 0.0 < item.variance_m2 < math.inf else _DEFAULT_VARIANCE_M2
    return min(max(claimed, _LEAST_VARIANCE_M2), _MOST_VARIANCE_M2) + anchor.position_sd_m**2
