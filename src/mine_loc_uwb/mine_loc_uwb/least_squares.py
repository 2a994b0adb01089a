"""Linear least-squares multilateration (paper A, eq. 1–5).

The circle of the last anchor is subtracted from the others, which leaves equations linear in the position:
2 (x_i − x_n) x + 2 (y_i − y_n) y = r_n² − r_i² with r_j² = d_j² − x_j² − y_j².
"""

import numpy as np

from mine_loc_uwb.fix import Array, Fix, FixStatus, no_fix

_RANK_TOLERANCE = 1e-6


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
        return no_fix(FixStatus.TOO_FEW_RANGES, dimensions, n)
    centre = anchors_m.mean(axis=0)  # keeps the squares small where coordinates are in the thousands
    nodes = (anchors_m - centre)[:, :dimensions]
    squares = ranges_m**2
    if height_m is not None:
        # A slant range shorter than the height difference is noise above or below the anchor: the horizontal part is 0.
        squares = np.maximum(squares - (anchors_m[:, 2] - height_m) ** 2, 0.0)
    A = 2.0 * (nodes[:-1] - nodes[-1])
    if np.linalg.matrix_rank(A, tol=_RANK_TOLERANCE * max(1.0, float(np.abs(A).max()))) < dimensions:
        return no_fix(FixStatus.DEGENERATE, dimensions, n)
    r2 = squares - np.sum(nodes**2, axis=1)
    solution = np.linalg.lstsq(A, r2[-1] - r2[:-1], rcond=None)[0]

    position = np.append(solution, 0.0)[:3] + centre
    if height_m is not None:
        position[2] = height_m
    return _judge(anchors_m, ranges_m, position, range_sd_m, dimensions, max_gdop)


def _judge(
    anchors_m: Array, ranges_m: Array, position: Array, range_sd_m: float, dimensions: int, max_gdop: float
) -> Fix:
    """Covariance from the geometry at the solution; GDOP beyond the limit is degenerate."""
    offsets = position - anchors_m
    distances = np.maximum(np.linalg.norm(offsets, axis=1), 1e-9)
    J = (offsets / distances[:, None])[:, :dimensions]
    information = J.T @ J
    if np.linalg.cond(information) > 1.0 / np.finfo(float).eps:
        return no_fix(FixStatus.DEGENERATE, dimensions, len(ranges_m))
    unit_covariance = np.linalg.inv(information)
    gdop = float(np.sqrt(np.trace(unit_covariance)))
    if gdop > max_gdop:
        return no_fix(FixStatus.DEGENERATE, dimensions, len(ranges_m), gdop)
    residuals = ranges_m - distances
    rms = float(np.sqrt(np.mean(residuals**2)))
    covariance = np.zeros((3, 3))
    covariance[:dimensions, :dimensions] = unit_covariance * max(range_sd_m, rms) ** 2
    return Fix(FixStatus.OK, position, covariance, dimensions, len(ranges_m), rms, gdop)
