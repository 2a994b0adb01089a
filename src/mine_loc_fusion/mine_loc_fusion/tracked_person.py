"""One person under fusion: the estimator with late inputs, and the rule that output stamps never go back."""

from collections import Counter, deque
from dataclasses import replace
from math import nan
from typing import Any

import numpy as np

from mine_loc_core.people import Person
from mine_loc_core.stamps import to_ns
from mine_loc_core.verdicts import Reason, Source, Verdict
from mine_loc_core.walkable_area import WalkableArea
from mine_loc_fusion.estimate import SOURCE_OF, Array, EpochInputs, Estimate, PlaceFix
from mine_loc_fusion.estimators import make_estimator
from mine_loc_fusion.late_inputs import LateInputCorrector
from mine_loc_fusion.mode import Mode, ModeLimits, mode_of
from mine_loc_fusion.parameters import FusionParameters

_COSTS_KEPT = 200
_INNOVATIONS_KEPT = 200


class TrackedPerson:
    """State and statistics of one person."""

    def __init__(
        self,
        person: Person,
        parameters: FusionParameters,
        height_m: float | None = None,
        area: WalkableArea | None = None,
    ) -> None:
        """`height_m` and `area` as in TightlyCoupled."""
        self.person = person
        self.epochs = 0
        self.late_epochs = 0
        self.reasons: Counter[Reason] = Counter()
        self.los_fraction = nan
        self.odom_position_m = (0.0, 0.0, 0.0)
        self.costs_s: deque[float] = deque(maxlen=_COSTS_KEPT)
        self._normalised_innovations: deque[float] = deque(maxlen=_INNOVATIONS_KEPT)
        self.disabled: set[Source] = set()
        self._parameters = parameters
        self._height_m, self._area = height_m, area
        self.reset()

    def reset(self) -> None:
        """Forget the estimate; statistics stay. Output stamps may start anew: time itself jumped, or a person asked."""
        p = self._parameters
        estimator = make_estimator(p.method, p.systematic_sd, self._height_m, self._area)
        self._corrector = LateInputCorrector(estimator, to_ns(self._parameters.history_s))
        self.published_ns: int | None = None

    def update(self, inputs: EpochInputs, *, late: bool) -> tuple[Verdict, ...]:
        """Use an epoch, but for the kinds of measurement that are switched off."""
        used, verdicts = _without(inputs, self.disabled)
        verdicts += self._corrector.update(used)
        self.epochs += 1
        self.late_epochs += late
        self.reasons.update(verdict.reason for verdict in verdicts)
        self._normalised_innovations.extend(
            v.mahalanobis_sq / v.degrees_of_freedom for v in verdicts if v.degrees_of_freedom
        )
        return verdicts

    def begin(self, stamp_ns: int, position_m: Array, covariance_m2: Array, yaw: tuple[float, float] | None) -> None:
        """Start at a place that somebody tells, whatever was believed."""
        self.reset()
        self._corrector.begin(stamp_ns, position_m, covariance_m2, yaw)

    def output(self, stamp_ns: int) -> Estimate | None:
        """The estimate to publish for `stamp_ns`, moved on to the last stamp published if that is later."""
        if self.published_ns is not None:
            stamp_ns = max(stamp_ns, self.published_ns)
        estimate = self._corrector.estimate(stamp_ns)
        if estimate is None or not (np.isfinite(estimate.position_m).all() and np.isfinite(estimate.covariance).all()):
            return None
        self.published_ns = stamp_ns
        return estimate

    def use_region(self, stamp_ns: int, region: PlaceFix) -> tuple[Verdict, ...]:
        """A coarse region counts only while nothing better does: no position yet, or a silence of its timeout."""
        estimate = self._corrector.estimate(stamp_ns)
        if estimate is not None and estimate.since_uwb_s < self._parameters.region_after_s:
            return ()
        return self.update(EpochInputs(stamp_ns, places=(region,)), late=False)

    def mode(self, stamp_ns: int) -> Mode:
        """What the estimate rests on."""
        estimate = self._corrector.estimate(stamp_ns)
        return Mode.INITIALISING if estimate is None else self.mode_of(estimate)

    def mode_of(self, estimate: Estimate) -> Mode:
        """What an estimate rests on."""
        p = self._parameters
        return mode_of(estimate, ModeLimits(p.uwb_timeout_s, p.step_timeout_s, p.lost_ce95_m))

    @property
    def nis(self) -> float:
        """Mean normalised innovation squared per degree of freedom; NaN = none yet."""
        return float(np.mean(self._normalised_innovations)) if self._normalised_innovations else nan


def _without(inputs: EpochInputs, disabled: set[Source]) -> tuple[EpochInputs, tuple[Verdict, ...]]:
    """The epoch without some kinds of measurement, and a verdict on each that is left out."""
    if not disabled:
        return inputs, ()
    kept: dict[str, Any] = {}
    refused: list[Verdict] = []
    for name, source_of in SOURCE_OF.items():
        items = getattr(inputs, name)
        kept[name] = tuple(item for item in items if source_of(item) not in disabled)
        refused += [Verdict(source_of(item), 0, Reason.DISABLED) for item in items if source_of(item) in disabled]
    return replace(inputs, **kept), tuple(refused)
