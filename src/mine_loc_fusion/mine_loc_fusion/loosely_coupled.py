"""What the estimators of solved positions and steps share: the order within an epoch, and a state to go back to."""

import copy
from abc import ABC, abstractmethod

from mine_loc_core.verdicts import Verdict
from mine_loc_fusion.estimate import EpochInputs, PositionFix, StepFix
from mine_loc_fusion.yaw_alignment import YawAlignment


class LooselyCoupled(ABC):
    """Positions first, then steps, at the epoch's instant (see `estimate.Estimator`)."""

    def __init__(self) -> None:
        self._alignment = YawAlignment()

    def update(self, inputs: EpochInputs) -> tuple[Verdict, ...]:
        """See Estimator."""
        self._advance(inputs.stamp_ns)
        verdicts = [self._use_position(fix, inputs.stamp_ns) for fix in inputs.positions]
        verdicts += [self._use_step(step, inputs.stamp_ns) for step in inputs.steps]
        return tuple(verdicts)

    def save(self) -> dict[str, object]:
        """See Estimator."""
        return {name: copy.copy(value) for name, value in vars(self).items()} | {"_alignment": self._alignment.copy()}

    def restore(self, saved: dict[str, object]) -> None:
        """See Estimator."""
        vars(self).update(saved)
        self._alignment = self._alignment.copy()

    @abstractmethod
    def _advance(self, stamp_ns: int) -> None:
        """Predict to an instant; to one before the state nothing changes."""

    @abstractmethod
    def _use_position(self, fix: PositionFix, stamp_ns: int) -> Verdict: ...

    @abstractmethod
    def _use_step(self, step: StepFix, stamp_ns: int) -> Verdict: ...
