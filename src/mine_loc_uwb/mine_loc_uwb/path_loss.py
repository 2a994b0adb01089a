"""Ranges from signal levels: log-distance path loss with log-normal shadowing (paper D, its RSS part).

L(r) = L_1 − 10 n log10(r / 1 m) + X, X ~ N(0, σ²) [dB]. Read backwards, ln r is normal about the median range with
standard deviation σ ln 10 / (10 n): a factor of about 1.8 in CM8 and 3 in CM7, which is why levels only help.
"""

from dataclasses import dataclass

import numpy as np

from mine_loc_uwb.fix import Array

_LEAST_RANGE_M = 0.1
_LEAST_PAIRS = 3


@dataclass(frozen=True, slots=True)
class PathLoss:
    """The model's three parameters; levels are true ones: `received_power.uncompress_dbm` of what a DW1000 reports."""

    level_1m_dbm: float
    exponent: float
    shadowing_db: float

    def level_dbm(self, range_m: Array) -> Array:
        """Median level at ranges of any shape; ranges below 0.1 m count as 0.1 m."""
        return np.asarray(self.level_1m_dbm - 10.0 * self.exponent * np.log10(np.maximum(range_m, _LEAST_RANGE_M)))

    def slope_db_per_m(self, range_m: Array) -> Array:
        """Derivative of `level_dbm`."""
        return np.asarray(-10.0 * self.exponent / np.log(10.0) / np.maximum(range_m, _LEAST_RANGE_M))

    def median_range_m(self, level_dbm: Array) -> Array:
        """Range at which these levels, of any shape, are the median."""
        return np.asarray(10.0 ** ((self.level_1m_dbm - level_dbm) / (10.0 * self.exponent)))

    @property
    def log_range_sd(self) -> float:
        """Standard deviation of ln r, read from one level."""
        return float(self.shadowing_db * np.log(10.0) / (10.0 * self.exponent))

    def power_of_range(self, level_dbm: Array, power: int) -> tuple[Array, float]:
        """Unbiased estimate of r^power from levels, and its standard deviation as a share of the true r^power.

        The median range to that power is e^(power² s²/2) too large on average, s being `log_range_sd`.
        """
        spread = (power * self.log_range_sd) ** 2
        return self.median_range_m(level_dbm) ** power * np.exp(-0.5 * spread), float(np.sqrt(np.expm1(spread)))


def fit_path_loss(range_m: Array, level_dbm: Array) -> PathLoss:
    """Fit by least squares to pairs of true range and true level, (n,) each; pairs with NaN are left out.

    Raises ValueError where they do not determine a path loss.
    """
    known = np.isfinite(range_m) & np.isfinite(level_dbm) & (range_m > 0.0)
    decades = np.log10(range_m[known])
    if len(decades) < _LEAST_PAIRS or np.ptp(decades) <= 0.0:
        raise ValueError(f"{len(decades)} pairs of range and level: at least {_LEAST_PAIRS} at different ranges needed")
    centred = decades - decades.mean()
    slope = float(centred @ level_dbm[known] / (centred @ centred))
    if slope >= 0.0:
        raise ValueError(f"level rises by {slope:.2f} dB a decade of range: must fall")
    level_1m_dbm = float(level_dbm[known].mean() - slope * decades.mean())
    residuals = level_dbm[known] - level_1m_dbm - slope * decades
    return PathLoss(level_1m_dbm, -slope / 10.0, float(np.sqrt(residuals @ residuals / (len(decades) - 2))))
