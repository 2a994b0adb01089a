"""A polynomial from measured to true range of links without line of sight (paper A, 2.2.3: f(d) = sum of a_k d^k).

It is kept as a Chebyshev series over the interval of the pairs it was fitted to, where powers of metres would lose
digits. It rises over that interval. Beyond, the correction is led to zero over a short way, whose ends are those of the
valid interval: the corrected range is continuous, rises everywhere, and is exactly the measured one outside.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numpy.polynomial import Chebyshev, Polynomial

Array = npt.NDArray[np.float64]

_LEAST_TAPER_M = 1.0


@dataclass(frozen=True, slots=True)
class RangePolynomial:
    """Chebyshev coefficients of the true range [m] over `fitted_m`, measured range [m]; low degree first."""

    coefficients: tuple[float, ...]
    fitted_m: tuple[float, float]
    residual_sd_m: float
    """Root of the mean squared error that the corrected range of a held-out pair has left."""

    @property
    def degree(self) -> int:
        """Of the polynomial."""
        return len(self.coefficients) - 1

    @property
    def valid_m(self) -> tuple[float, float]:
        """Measured ranges [m] that are changed at all."""
        low_m, high_m = self.fitted_m
        ends = self._series()(np.array(self.fitted_m)) - np.array(self.fitted_m)
        ways = np.maximum(2.0 * np.abs(ends), _LEAST_TAPER_M)
        return max(low_m - float(ways[0]), 0.0), high_m + float(ways[1])

    def rises(self) -> bool:
        """Whether true ranges are positive and rise with the measured ones, over the fitted interval and beyond."""
        series = self._series()
        slope = series.deriv()
        turning = slope.deriv().roots() if self.degree > 2 else np.zeros(0)
        places = np.concatenate([self.fitted_m, turning[np.isreal(turning)].real])
        inside = places[(places >= self.fitted_m[0]) & (places <= self.fitted_m[1])]
        return bool(np.all(slope(inside) > 0.0) and series(self.fitted_m[0]) > 0.0)

    def excess_m(self, measured_m: Array) -> Array:
        """How much too long ranges are taken to be [m], any shape; held beyond the fitted interval, NaN stays."""
        within = np.clip(measured_m, *self.fitted_m)
        return np.asarray(within - self._series()(within))

    def correction_m(self, measured_m: Array) -> Array:
        """What is subtracted from ranges [m]: the excess, led to zero at the ends of the valid interval."""
        knots = (self.valid_m[0], *self.fitted_m, self.valid_m[1])
        return np.asarray(np.interp(measured_m, knots, (0.0, 1.0, 1.0, 0.0)) * self.excess_m(measured_m))

    def true_range_m(self, measured_m: Array) -> Array:
        """Corrected ranges [m], any shape; NaN stays NaN."""
        return np.asarray(measured_m - self.correction_m(measured_m))

    def powers(self) -> tuple[float, ...]:
        """The paper's a_0, a_1 ... over metres: to be read, not to be computed with."""
        return tuple(self._series().convert(kind=Polynomial).coef.tolist())

    def _series(self) -> Chebyshev:
        return Chebyshev(np.array(self.coefficients), domain=self.fitted_m)
