"""A polynomial from measured to true range of links without line of sight (paper A, 2.2.3: f(d) = sum of a_k d^k).

It is kept in Bernstein form over the interval of the pairs it was fitted to: control values that rise make a polynomial
that rises, and powers of metres, which lose digits, are never formed. Beyond the interval the correction is led to zero
over a short way, whose ends are those of the valid interval: the corrected range is continuous, rises everywhere, and
is exactly the measured one outside.
"""

from dataclasses import dataclass
from math import comb

import numpy as np
import numpy.typing as npt
from numpy.polynomial import Polynomial

Array = npt.NDArray[np.float64]

_LEAST_TAPER_M = 1.0


def bernstein_basis(share: Array, degree: int) -> Array:
    """Bernstein polynomials of a degree at `share` (n,) of the interval, 0..1: (n, degree + 1)."""
    order = np.arange(degree + 1)
    weight = np.array([comb(degree, each) for each in order], np.float64)
    return np.asarray(weight * share[:, None] ** order * (1.0 - share[:, None]) ** (degree - order))


@dataclass(frozen=True, slots=True)
class RangePolynomial:
    """True range [m] over `fitted_m`, shortest and longest measured range [m], by two or more control values [m]."""

    control_m: tuple[float, ...]
    fitted_m: tuple[float, float]
    residual_sd_m: float
    """Root of the mean squared error that the corrected range of a held-out pair has left."""

    @property
    def degree(self) -> int:
        """Of the polynomial."""
        return len(self.control_m) - 1

    @property
    def valid_m(self) -> tuple[float, float]:
        """Measured ranges [m] between which anything is changed; no wider than keeps the corrected range rising."""
        (low_m, high_m), first_m, last_m = self.fitted_m, self.control_m[0], self.control_m[-1]
        below_m = max(2.0 * abs(low_m - first_m), _LEAST_TAPER_M)
        above_m = max(2.0 * abs(high_m - last_m), _LEAST_TAPER_M)
        return max(low_m - below_m, 0.0), high_m + above_m

    def rises(self) -> bool:
        """Whether true ranges are positive and rise with the measured ones, over the fitted interval and beyond."""
        return self.control_m[0] > 0.0 and bool(np.all(np.diff(self.control_m) > 0.0))

    def excess_m(self, measured_m: Array) -> Array:
        """How much too long ranges are taken to be [m], any shape; held beyond the fitted interval, NaN stays."""
        low_m, high_m = self.fitted_m
        within_m = np.clip(measured_m, low_m, high_m)
        share = np.ravel((within_m - low_m) / (high_m - low_m))
        true_m = bernstein_basis(share, self.degree) @ np.array(self.control_m)
        return np.asarray(within_m - true_m.reshape(np.shape(within_m)))

    def correction_m(self, measured_m: Array) -> Array:
        """What is subtracted from ranges [m]: the excess, led to zero at the ends of the valid interval."""
        knots = (self.valid_m[0], *self.fitted_m, self.valid_m[1])
        return np.asarray(np.interp(measured_m, knots, (0.0, 1.0, 1.0, 0.0)) * self.excess_m(measured_m))

    def true_range_m(self, measured_m: Array) -> Array:
        """Corrected ranges [m], any shape; NaN stays NaN."""
        return np.asarray(measured_m - self.correction_m(measured_m))

    def powers(self) -> tuple[float, ...]:
        """The paper's a_0, a_1 ... over metres: to be read, not to be computed with."""
        places_m = np.linspace(*self.fitted_m, self.degree + 1)
        exact = Polynomial.fit(places_m, places_m - self.excess_m(places_m), self.degree)
        return tuple(exact.convert().coef.tolist())
