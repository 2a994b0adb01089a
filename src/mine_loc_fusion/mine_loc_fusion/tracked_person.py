"""One person under fusion: the estimator with late inputs, and the rule that output stamps never go back."""

from collections import Counter, deque
from math import nan

import numpy as np

from mine_loc_core.people import Person
from mine_loc_core.stamps import to_ns
from mine_loc_core.verdicts import Reason, Verdict
from mine_loc_fusion.estimate import EpochInputs, Estimate, Mode
from mine_loc_fusion.late_inputs import LateInputCorrector
from mine_loc_fusion.parameters import FusionParameters
from mine_loc_fusion.pose_filter import PoseFilter

_COSTS_KEPT = 1000
_INNOVATIONS_KEPT = 200


class TrackedPerson:
    """State and statistics of one person."""

    def __init__(self, person: Person, parameters: FusionParameters) -> None:
        self.person = person
        self.epochs = 0
        self.late_epochs = 0
        self.reasons: Counter[Reason] = Counter()
        self.los_fraction = nan
        self.odom_position_m = (0.0, 0.0, 0.0)
        self.costs_s: deque[float] = deque(maxlen=_COSTS_KEPT)
        self._normalised_innovations: deque[float] = deque(maxlen=_INNOVATIONS_KEPT)
        self._parameters = parameters
        self.reset()

    def reset(self) -> None:
        """Forget the estimate; statistics stay. Output stamps may start anew: time itself jumped, or a person asked."""
        self._corrector = LateInputCorrector(PoseFilter(self._parameters), to_ns(self._parameters.history_s))
        self.published_ns: int | None = None

    def update(self, inputs: EpochInputs, *, late: bool) -> tuple[Verdict, ...]:
        """Use an epoch."""
        verdicts = self._corrector.update(inputs)
        self.epochs += 1
        self.late_epochs += late
        self.reasons.update(verdict.reason for verdict in verdicts)
        self._normalised_innovations.extend(
            v.mahalanobis_sq / v.degrees_of_freedom for v in verdicts if v.degrees_of_freedom
        )
        return verdicts

    def output(self, stamp_ns: int) -> Estimate | None:
        """The estimate to publish for `stamp_ns`, moved on to the last stamp published if that is later."""
        if self.published_ns is not None:
            stamp_ns = max(stamp_ns, self.published_ns)
        estimate = self._corrector.estimate(stamp_ns)
        if estimate is None or not (np.isfinite(estimate.position_m).all() and np.isfinite(estimate.covariance).all()):
            return None
        self.published_ns = stamp_ns
        return estimate

    def mode(self, stamp_ns: int) -> Mode:
        """What the estimate rests on."""
        estimate = self._corrector.estimate(stamp_ns)
        return Mode.INITIALISING if estimate is None else estimate.mode

    @property
    def nis(self) -> float:
        """Mean normalised innovation squared per degree of freedom; NaN = none yet."""
        return float(np.mean(self._normalised_innovations)) if self._normalised_innovations else nan
