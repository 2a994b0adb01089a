"""From what a tag measured to a position and a verdict on each measurement: the intake, then the solver of that tag."""

import math
from collections import OrderedDict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from mine_loc_core.site import Anchor
from mine_loc_core.stamps import NS_PER_S
from mine_loc_core.verdicts import Reason, Source, Verdict
from mine_loc_uwb.fix import Fix
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.parameters import UwbSolverParameters
from mine_loc_uwb.range_checks import stamp_reason
from mine_loc_uwb.range_correction import RangeCorrection
from mine_loc_uwb.range_intake import MOST_TAGS, MeasuredRange, RangeIntake
from mine_loc_uwb.solver import Solution, Solver
from mine_loc_uwb.solvers import RANGE_SOLVERS, TDOA_SOLVERS


@dataclass(slots=True)
class _Tag:
    """What is kept for one tag and one kind of measurement."""

    solver: Solver
    last_ns: int | None = None


class RoundSolver:
    """Solves rounds and blinks of any number of tags against one anchor map."""

    def __init__(
        self,
        anchors: Iterable[Anchor],
        parameters: UwbSolverParameters,
        correction: RangeCorrection | None = None,
    ) -> None:
        self.intake = RangeIntake(anchors, parameters.max_range_m, correction)
        self._parameters = parameters
        self._tags: OrderedDict[tuple[int, Source], _Tag] = OrderedDict()

    @property
    def parameters(self) -> UwbSolverParameters:
        """Methods and limits in force; new ones begin with new solvers."""
        return self._parameters

    @parameters.setter
    def parameters(self, parameters: UwbSolverParameters) -> None:
        self._parameters = parameters
        self.intake.max_range_m = parameters.max_range_m
        self.reset()

    def solve(
        self, tag_id: int, stamp_ns: int, now_ns: int, ranges: Sequence[MeasuredRange], height_m: float | None
    ) -> tuple[Fix | None, tuple[Verdict, ...]]:
        """Position of one tag from a ranging round, and one verdict a range, in their order.

        A round whose stamp does not follow the last one has no position: output stamps never go back.
        """
        return self._solve(tag_id, stamp_ns, now_ns, ranges, height_m, Source.RANGE)

    def solve_blink(
        self, tag_id: int, stamp_ns: int, now_ns: int, arrivals: Sequence[MeasuredRange], height_m: float | None
    ) -> tuple[Fix | None, tuple[Verdict, ...]]:
        """Position of one tag from the arrivals of a blink, the reference anchor's being 0 (see `Measurements`)."""
        return self._solve(tag_id, stamp_ns, now_ns, arrivals, height_m, Source.TDOA)

    def reset(self) -> None:
        """Forget what rests on earlier stamps."""
        self._tags.clear()
        self.intake.reset()

    def forget(self, tag_id: int) -> None:
        """Release what is kept for a tag that went silent."""
        self.intake.forget(tag_id)
        for source in (Source.RANGE, Source.TDOA):
            self._tags.pop((tag_id, source), None)

    def _solve(
        self,
        tag_id: int,
        stamp_ns: int,
        now_ns: int,
        items: Sequence[MeasuredRange],
        height_m: float | None,
        source: Source,
    ) -> tuple[Fix | None, tuple[Verdict, ...]]:
        tag = self._tag(tag_id, source)
        timely = stamp_reason(stamp_ns, tag.last_ns, now_ns)
        if timely is not Reason.ACCEPTED:
            return None, tuple(Verdict(source, item.anchor_id, timely) for item in items)
        tag.last_ns = stamp_ns
        measurements, reasons = self.intake.take(tag_id, stamp_ns, items, height_m, source)
        used = [number for number, reason in enumerate(reasons) if reason is Reason.ACCEPTED]
        solution = tag.solver.solve(measurements)
        verdicts = {
            number: Verdict(source, items[number].anchor_id, *judged)
            for number, judged in zip(used, _judgements(solution, measurements), strict=True)
        }
        return solution.fix, tuple(
            verdicts.get(number) or Verdict(source, item.anchor_id, reasons[number])
            for number, item in enumerate(items)
        )

    def _tag(self, tag_id: int, source: Source) -> _Tag:
        """The tag heard longest ago makes room when there are too many."""
        key = tag_id, source
        if key not in self._tags:
            if len(self._tags) >= MOST_TAGS:
                self._tags.popitem(last=False)
            parameters = self._parameters
            make = RANGE_SOLVERS[parameters.method] if source is Source.RANGE else TDOA_SOLVERS[parameters.tdoa_method]
            self._tags[key] = _Tag(make(parameters))
        self._tags.move_to_end(key)
        return self._tags[key]


def rehearse(parameters: UwbSolverParameters, dimensions: int) -> None:
    """Solve two made-up rounds, so that what is compiled is there before the first real one comes."""
    corners = [(0.0, 0.0, 2.0), (9.0, 0.0, 3.0), (9.0, 9.0, 2.0), (0.0, 9.0, 3.0), (4.0, 4.0, 9.0)]
    solver = RoundSolver([Anchor(i + 1, "", corner, 0.0, 0.0) for i, corner in enumerate(corners)], parameters)
    for stamp_ns in (1, NS_PER_S):
        ranges = [MeasuredRange(i + 1, math.dist(corner, (3.0, 5.0, 1.0)), 0.01) for i, corner in enumerate(corners)]
        solver.solve(1, stamp_ns, stamp_ns, ranges, None if dimensions == 3 else 1.0)


def _judgements(solution: Solution, measurements: Measurements) -> Iterable[tuple[Reason, float, float, int, float]]:
    """Reason, d², gate, degrees of freedom and innovation of each measurement; NaN where there is none."""
    innovation_m = measurements.range_m - np.linalg.norm(measurements.anchors_m - solution.fix.position_m, axis=1)
    if measurements.shared_offset:
        innovation_m -= np.min(innovation_m, initial=math.inf)
    gated = not math.isnan(solution.gate)
    return [
        (reason, distance_sq, solution.gate, int(gated), error_m)
        for reason, distance_sq, error_m in zip(
            solution.reasons, solution.mahalanobis_sq.tolist(), innovation_m.tolist(), strict=True
        )
    ]
