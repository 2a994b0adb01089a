"""Late inputs: a bounded history of states, from which the estimator is run again with the late input in its place."""

from collections import deque
from typing import Any

from mine_loc_core.verdicts import Reason, Verdict
from mine_loc_fusion.estimate import SOURCE_OF, Array, EpochInputs, Estimate, Estimator


class LateInputCorrector:
    """An estimator that takes epochs out of order, `history_ns` back."""

    def __init__(self, estimator: Estimator, history_ns: int) -> None:
        self._estimator = estimator
        self._history_ns = history_ns
        self._history: deque[tuple[EpochInputs, Any]] = deque()  # (inputs, state before them), in order of stamp

    def update(self, inputs: EpochInputs) -> tuple[Verdict, ...]:
        """Use an epoch; an old one by rewinding. Beyond the history its measurements are refused as stale."""
        replay: list[EpochInputs] = []
        if self._history and inputs.stamp_ns < self._history[-1][0].stamp_ns - self._history_ns:
            return _stale(inputs)
        while self._history and self._history[-1][0].stamp_ns > inputs.stamp_ns:
            later, before = self._history.pop()
            replay.append(later)
        if replay:
            self._estimator.restore(before)
        verdicts = self._step(inputs)
        for later in reversed(replay):
            self._step(later)
        self._drop_old()
        return verdicts

    def begin(self, stamp_ns: int, position_m: Array, covariance_m2: Array, yaw: tuple[float, float] | None) -> None:
        """See Estimator; what came before is forgotten."""
        self._history.clear()
        self._estimator.begin(stamp_ns, position_m, covariance_m2, yaw)

    def estimate(self, stamp_ns: int) -> Estimate | None:
        """See Estimator."""
        return self._estimator.estimate(stamp_ns)

    def _step(self, inputs: EpochInputs) -> tuple[Verdict, ...]:
        self._history.append((inputs, self._estimator.save()))
        return self._estimator.update(inputs)

    def _drop_old(self) -> None:
        oldest_ns = self._history[-1][0].stamp_ns - self._history_ns
        while len(self._history) > 1 and self._history[0][0].stamp_ns < oldest_ns:
            self._history.popleft()


def _stale(inputs: EpochInputs) -> tuple[Verdict, ...]:
    sources = [source_of(item) for name, source_of in SOURCE_OF.items() for item in getattr(inputs, name)]
    return tuple(Verdict(source, 0, Reason.STALE) for source in sources)
