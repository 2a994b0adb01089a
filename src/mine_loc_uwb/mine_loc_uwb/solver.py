"""The one interface of all position solvers: measurements of one tag in, a fix and a judgement of each link out."""

from dataclasses import dataclass
from typing import Protocol

from mine_loc_core.verdicts import Reason
from mine_loc_uwb.fix import Array, Fix
from mine_loc_uwb.measurements import Measurements


@dataclass(frozen=True, slots=True, eq=False)
class Solution:
    """A fix, and for each of the n measurements why it was used or not.

    `mahalanobis_sq` (n,) is NaN where a solver has no prediction to compare with; `gate` is the threshold on it, NaN
    without a gate.
    """

    fix: Fix
    reasons: tuple[Reason, ...]
    mahalanobis_sq: Array
    gate: float


class Solver(Protocol):
    """Positions of one tag; keeps the state of that tag where the method has one."""

    def solve(self, measurements: Measurements) -> Solution:
        """Take the measurements of the next instant; stamps rise from call to call.

        Never raises for what can be measured: too little of it, or a geometry that does not determine the position,
        gives a fix that says so.
        """
        ...  # pragma: no cover
