"""Fitting a range polynomial: reweighted least squares, degree by cross-validation (paper A, 2.2.3).

The paper solves normal equations in powers of the range. Here the true range is expanded in Bernstein polynomials over
the interval of the pairs and solved by QR, and the steps from one control value to the next are bound to rise
(nonnegative least squares, Lawson and Hanson 1974). Errors without line of sight are skewed, with a long tail to one
side, which draws a mean away from where most ranges lie: the least sum of absolute errors is the default, the paper's
least squares a choice.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.range_polynomial import RangePolynomial, bernstein_basis

Array = npt.NDArray[np.float64]
Groups = npt.NDArray[np.int64]
Loss = Literal["absolute", "squares"]

LEAST_PAIRS = 20
_ENDS = (0.005, 0.995)
"""Shares of the measured ranges between which the polynomial holds, so that a stray range does not widen it."""
_ROUNDS = 25
_SMALLEST_ERROR_M = 0.005
"""Absolute errors below count as squares: under the noise of any range, and no weight grows without bound."""
_CONVERGED_M = 1e-3
_LEAST_SLOPE = 0.05
"""Of true over measured range: less would make one distance of many."""
_LEAST_TRUE_M = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class PolynomialFit:
    """A polynomial and how it came about."""

    polynomial: RangePolynomial
    held_out_m: Array
    """True ranges (n,) as predicted for each pair by the polynomials of the folds that had not seen its group."""
    loss_m_by_degree: tuple[float, ...]
    """Held-out loss of degrees 1, 2 ...: mean absolute or root mean squared error [m]."""


def fit_polynomial(
    measured_m: Array, true_m: Array, group: Groups, *, loss: Loss = "absolute", max_degree: int = 6, folds: int = 10
) -> PolynomialFit:
    """Fit pairs (n,), all finite; pairs of one group (n,), those of one place, are held out together.

    Of the degrees whose held-out loss is within one standard error of the least (Breiman et al. 1984), the lowest is
    taken. Raises ConfigurationError when there are fewer than LEAST_PAIRS pairs or two groups.
    """
    names, group = np.unique(group, return_inverse=True)
    if len(measured_m) < LEAST_PAIRS or len(names) < 2:
        raise ConfigurationError(
            f"pairs without line of sight: {len(measured_m)} in {len(names)} groups; "
            f"allowed: {LEAST_PAIRS} or more in at least 2 groups"
        )
    fold = fold_of_groups(len(names), folds)[group]
    degrees = range(1, max(min(max_degree, len(names) - 1), 1) + 1)
    held_out_m = np.stack([_held_out(measured_m, true_m, fold, degree, loss) for degree in degrees])
    losses = np.abs(held_out_m - true_m) ** (2 if loss == "squares" else 1)
    best = _simplest(losses, fold)
    sd_m = float(np.sqrt(np.mean((held_out_m[best] - true_m) ** 2)))
    polynomial = _fit_degree(measured_m, true_m, degrees[best], loss, sd_m)
    by_degree = losses.mean(axis=1) ** (0.5 if loss == "squares" else 1.0)
    return PolynomialFit(polynomial, held_out_m[best], tuple(by_degree.tolist()))


def fold_of_groups(groups: int, folds: int) -> Groups:
    """Fold of each group (groups,), as even as possible and always the same."""
    return np.random.default_rng(0).permutation(groups) % min(folds, groups)


def _simplest(losses: Array, fold: Groups) -> int:
    """Lowest degree within one standard error, over folds, of the best; losses: (degrees, n)."""
    by_fold = np.array([[row[fold == each].mean() for each in np.unique(fold)] for row in losses])
    best = int(losses.mean(axis=1).argmin())
    worse = by_fold - by_fold[best]
    error = worse.std(axis=1, ddof=1) / np.sqrt(by_fold.shape[1])
    return int(np.flatnonzero(worse.mean(axis=1) <= error)[0])


def _held_out(measured_m: Array, true_m: Array, fold: Groups, degree: int, loss: Loss) -> Array:
    predicted_m = np.empty(len(measured_m))
    for each in np.unique(fold):
        out = fold == each
        polynomial = _fit_degree(measured_m[~out], true_m[~out], degree, loss, 0.0)
        predicted_m[out] = polynomial.true_range_m(measured_m[out])
    return predicted_m


def _fit_degree(measured_m: Array, true_m: Array, degree: int, loss: Loss, sd_m: float) -> RangePolynomial:
    low_m, high_m = (float(end) for end in np.quantile(measured_m, _ENDS))
    high_m = max(high_m, low_m + 1e-3)
    used = (measured_m >= low_m) & (measured_m <= high_m)
    basis = bernstein_basis((measured_m[used] - low_m) / (high_m - low_m), degree)
    control_m = _solve(basis, true_m[used], loss, _LEAST_SLOPE * (high_m - low_m) / degree)
    return RangePolynomial(tuple(control_m.tolist()), (low_m, high_m), sd_m)


def _solve(basis: Array, true_m: Array, loss: Loss, least_step_m: float) -> Array:
    """Rising control values of least squares, or of least absolute errors by reweighting (Schlossmacher 1973).

    The unknowns are the first control value and the steps to the next, each with its lower bound.
    """
    steps = np.cumsum(basis[:, ::-1], axis=1)[:, ::-1]
    lower_m = np.full(basis.shape[1], least_step_m)
    lower_m[0] = _LEAST_TRUE_M
    root_weight, found = np.ones(len(basis)), lower_m
    for _ in range(_ROUNDS if loss == "absolute" else 1):
        triangle, rotated = _reduced(steps * root_weight[:, None], true_m * root_weight)
        before, found = found, lower_m + nnls(triangle, rotated - triangle @ lower_m)[0]
        root_weight = 1.0 / np.sqrt(np.maximum(np.abs(steps @ found - true_m), _SMALLEST_ERROR_M))
        if np.abs(found - before).max() < _CONVERGED_M:
            break
    return np.asarray(np.cumsum(found))


def _reduced(matrix: Array, right: Array) -> tuple[Array, Array]:
    """The same least-squares problem in as many rows as columns, by QR."""
    orthogonal, triangle = np.linalg.qr(matrix)
    return triangle, orthogonal.T @ right
