"""Linear least-squares multilateration (paper A, eq. 1–5).

The circle of the last anchor is subtracted from the others, which leaves equations linear in the position:
2 (x_i − x_n) x + 2 (y_i − y_n) y = r_n² − r_i² with r_j² = d_j² − x_j² − y_j².
"""

import math

import numpy as np

from mine_loc_core.gates import chi2_quantile
from mine_loc_core.verdicts import Reason
from mine_loc_uwb.fix import Array, Fix, FixStatus, no_fix
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.solver import Solution

_RANK_TOLERANCE = 1e-6
_CONTRADICTION = 0.999  # residuals beyond this quantile say that the ranges are worse than they claim


def solve(
    anchors_m: Array, ranges_m: Array, *, range_sd_m: float, height_m: float | None = None, max_gdop: float = 10.0
) -> Fix:
    """Position of one tag from one round.

    `anchors_m` has shape (n, 3), `ranges_m` (n,) slant ranges, all finite and positive. With `height_m` the position
    is solved in the plane of that height (slant ranges are reduced to it), without it in space. Too few ranges or a
    geometry that does not determine the position give a Fix that says so and no position.
    """
    dimensions = 3 if height_m is None else 2
    n = len(ranges_m)
    if n < dimensions + 1:
        return no_fix(FixStatus.TOO_FEW_RANGES, dimensions)
    centre = anchors_m.mean(axis=0)  # keeps the squares small where coordinates are in the thousands
    nodes = (anchors_m - centre)[:, :dimensions]
    squares = ranges_m**2
    if height_m is not None:
        # A slant range shorter than the height difference is noise above or below the anchor: the horizontal part is 0.
        squares = np.maximum(squares - (anchors_m[:, 2] - height_m) ** 2, 0.0)
    A = 2.0 * (nodes[:-1] - nodes[-1])
    if np.linalg.matrix_rank(A, tol=_RANK_TOLERANCE * max(1.0, float(np.abs(A).max()))) < dimensions:
        return no_fix(FixStatus.DEGENERATE, dimensions)
    r2 = squares - np.sum(nodes**2, axis=1)
    inverse = np.linalg.pinv(A)
    b = r2[-1] - r2[:-1]
    solution = inverse @ b
    # How errors of the slant ranges enter the differences: d(r_n² − r_i²) = 2 (d_n δ_n − d_i δ_i).
    G = np.column_stack([-2.0 * np.diag(ranges_m[:-1]), np.full(n - 1, 2.0 * ranges_m[-1])])
    gain = inverse @ G
    variance = _range_variance(b - A @ solution, G - A @ gain, n - 1 - dimensions, range_sd_m)

    position = np.append(solution, 0.0)[:3] + centre
    if height_m is not None:
        position[2] = height_m
    return _judge(anchors_m, ranges_m, position, gain @ gain.T * variance, max_gdop)


class LeastSquares:
    """Each round by itself; see `Solver`."""

    def __init__(self, max_gdop: float = 10.0) -> None:
        self._max_gdop = max_gdop

    def solve(self, measurements: Measurements) -> Solution:
        """See `Solver`."""
        fix = solve(
            measurements.anchors_m,
            measurements.range_m,
            range_sd_m=math.sqrt(np.mean(measurements.variance_m2)) if len(measurements) else math.nan,
            height_m=measurements.height_m,
            max_gdop=self._max_gdop,
        )
        reason = Reason.ACCEPTED if fix.status is FixStatus.OK else Reason.DEGENERATE
        return Solution(fix, (reason,) * len(measurements), np.full(len(measurements), math.nan), math.nan)


def _range_variance(residuals: Array, residual_gain: Array, redundancy: int, range_sd_m: float) -> float:
    """The variance given for the ranges, or that of the residuals [m²] where they contradict it."""
    if redundancy < 1:
        return range_sd_m**2
    observed = float(np.sum(residuals**2) / np.sum(residual_gain**2))
    believable = range_sd_m**2 * chi2_quantile(_CONTRADICTION, redundancy) / redundancy
    return observed if observed > believable else range_sd_m**2


def _judge(anchors_m: Array, ranges_m: Array, position: Array, solved_covariance: Array, max_gdop: float) -> Fix:
    """Geometry and residuals at the solution: a GDOP beyond the limit is degenerate."""
    dimensions = len(solved_covariance)
    offsets = position - anchors_m
    distances = np.maximum(np.linalg.norm(offsets, axis=1), 1e-9)
    J = (offsets / distances[:, None])[:, :dimensions]
    information = J.T @ J
    if np.linalg.cond(information) > 1.0 / np.finfo(float).eps:
        return no_fix(FixStatus.DEGENERATE, dimensions)
    gdop = float(np.sqrt(np.trace(np.linalg.inv(information))))
    if gdop > max_gdop:
        return no_fix(FixStatus.DEGENERATE, dimensions, gdop)
    residuals = ranges_m - distances
    rms = float(np.sqrt(np.mean(residuals**2)))
    covariance = np.zeros((3, 3))
    covariance[:dimensions, :dimensions] = solved_covariance
    return Fix(FixStatus.OK, position, covariance, dimensions, len(ranges_m), rms, gdop)
