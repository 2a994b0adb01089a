"""What one blink says about a place: likelihood of its time differences and levels, gradient and Fisher information."""

from dataclasses import dataclass

import numpy as np

from mine_loc_uwb.fix import Array
from mine_loc_uwb.late_arrival import LateArrival
from mine_loc_uwb.link_geometry import weights
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.path_loss import PathLoss

_LEAST_RANGE_M = 0.1
_APART = 3.0


@dataclass(frozen=True, slots=True)
class TdoaRssParameters:
    """`path_loss` None = time differences alone."""

    path_loss: PathLoss | None = None
    excess_sd_m: float = 0.0
    """What NLOS adds to the arrivals' own noise."""
    law: LateArrival | None = None
    """How late arrivals are by their level; None = not on average."""
    level_weight: float = 1.0
    """Of levels against arrivals, found by trial as in the paper: less than 1 because shadowing stays for metres."""
    max_gdop: float = 10.0
    """Limit on the fix's standard deviation as a multiple of an arrival's."""


@dataclass(frozen=True, slots=True)
class Whereabouts:
    """Where the tag was: (3,), and the variance of each coordinate by now."""

    place_m: Array
    variance_m2: float


@dataclass(frozen=True, slots=True)
class Blink:
    """What was measured, the first node at the origin, in the d solved dimensions."""

    node_m: Array  # (n, d)
    over_m: Array  # (n,), a node's height over the tag; 0 in space
    later_m: Array  # (n,), d_i; 0 of the first
    variance_m2: Array  # (n,), of the arrivals
    weight: Array  # (n, n), of the arrivals
    first_m: float  # r_1 as measured, NaN of a blink
    level_dbm: Array  # (n,), NaN = none
    path_loss: PathLoss | None
    level_weight: float
    last: Whereabouts | None  # (d,) and about the first node

    @staticmethod
    def of(
        measurements: Measurements, parameters: TdoaRssParameters, last: Whereabouts | None, dimensions: int
    ) -> "Blink":
        """Take the mean lateness off and put the first node at the origin."""
        anchors_m, arrival_m = measurements.anchors_m, measurements.range_m
        height_m, origin = measurements.height_m, anchors_m[0, :dimensions]
        variance_m2 = measurements.variance_m2 + parameters.excess_sd_m**2
        shared, levels = measurements.shared_offset, measurements.receive_power_dbm
        if parameters.law is not None:
            late_m, more_m2 = parameters.law.moments(levels)
            arrival_m, variance_m2 = arrival_m - late_m, variance_m2 + more_m2
        return Blink(
            anchors_m[:, :dimensions] - origin,
            np.zeros(len(arrival_m)) if height_m is None else anchors_m[:, 2] - height_m,
            arrival_m - arrival_m[0],
            variance_m2,
            weights(variance_m2, shared_offset=shared),
            np.nan if shared else float(arrival_m[0]),
            levels if parameters.path_loss is not None else np.full_like(levels, np.nan),
            parameters.path_loss,
            parameters.level_weight,
            None if last is None else Whereabouts(last.place_m[:dimensions] - origin, last.variance_m2),
        )

    @property
    def constants(self) -> Array:
        """K_i (n,)."""
        return np.asarray(np.sum(self.node_m**2, axis=1) + self.over_m**2 - self.over_m[0] ** 2)

    @property
    def has_range(self) -> bool:
        """Whether anything tells ranges rather than differences."""
        return bool(np.isfinite(self.first_m) or np.isfinite(self.level_dbm).any())

    def ranges_m(self, place_m: Array) -> Array:
        """Slant ranges (n,)."""
        squares = np.sum((place_m - self.node_m) ** 2, axis=1) + self.over_m**2
        return np.asarray(np.sqrt(np.maximum(squares, _LEAST_RANGE_M**2)))

    def residual_m(self, place_m: Array) -> Array:
        """Of the arrivals (n,), their shared offset still in."""
        return self.later_m + (0.0 if np.isnan(self.first_m) else self.first_m) - self.ranges_m(place_m)

    def contradiction(self, place_m: Array) -> float:
        """χ² of the arrivals at a place."""
        residual = self.residual_m(place_m)
        return float(residual @ self.weight @ residual)

    def cost(self, place_m: Array) -> float:
        """Minus the logarithm of the likelihood of what was measured at a place."""
        cost = 0.5 * self.contradiction(place_m)
        if self.path_loss is not None:
            off_db = self.level_dbm - self.path_loss.level_dbm(self.ranges_m(place_m))
            cost += 0.5 * self.level_weight * float(np.nansum((off_db / self.path_loss.shadowing_db) ** 2))
        return cost

    def surprise(self, place_m: Array) -> float:
        """The same with the whereabouts known before."""
        if self.last is None:
            return self.cost(place_m)
        return self.cost(place_m) + 0.5 * float(np.sum((place_m - self.last.place_m) ** 2)) / self.last.variance_m2

    def information(self, place_m: Array) -> Array:
        """Fisher information of a place (d, d)."""
        ranges_m = self.ranges_m(place_m)
        direction = (place_m - self.node_m) / ranges_m[:, None]
        information = direction.T @ self.weight @ direction
        if self.path_loss is not None:
            slope = direction[np.isfinite(self.level_dbm)] / ranges_m[np.isfinite(self.level_dbm), None]
            information += slope.T @ slope * (self.level_weight / self.path_loss.log_range_sd**2)
        return np.asarray(information)

    def ascent(self, place_m: Array) -> Array:
        """Gradient (d,) of the logarithm of the likelihood of what was measured."""
        ranges_m = self.ranges_m(place_m)
        direction = (place_m - self.node_m) / ranges_m[:, None]
        ascent = direction.T @ self.weight @ self.residual_m(place_m)
        if self.path_loss is not None:
            off_db = np.nan_to_num(self.level_dbm - self.path_loss.level_dbm(ranges_m))
            slope = self.path_loss.slope_db_per_m(ranges_m)[:, None] * direction
            ascent = ascent + slope.T @ off_db * (self.level_weight / self.path_loss.shadowing_db**2)
        return np.asarray(ascent)

    def apart(self, one_m: Array, other_m: Array) -> bool:
        """Whether two places are more than an error of the first away from each other."""
        step = one_m - other_m
        return bool(step @ self.information(other_m) @ step > _APART**2)
