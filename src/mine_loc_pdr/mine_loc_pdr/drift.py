"""How far dead reckoning may be off: the covariance of its errors, to first order.

Error states: x, y (m, odom), heading (rad), gyro bias about the vertical (rad/s), step scale (1), and the direction of
a reference beside the way (rad, see `refer`). Each is estimate minus truth. A heading error
bends every later step and a scale error stretches all of them, so the errors of position are not a sum of independent
steps: they grow with the distance, not with its root. Plain linear error propagation, e.g. Groves, "Principles of
GNSS, Inertial, and Multisensor Integrated Navigation Systems", 2nd ed., chapter 3.
"""

import math

import numpy as np
from numpy.typing import NDArray

from mine_loc_pdr.rest import MEAN_RATE_SD_RAD_S

Array = NDArray[np.float64]

# The N100 has no published noise figures. Class figures for such chips: 1.2e-4 to 2.4e-4 rad/s/√Hz, three to ten
# times that when measured; turn-on bias 0.1 to 0.5 °/s; bias instability 5 to 10 °/h. Assumed from these:
RATE_NOISE_RAD_SQRT_S = 1e-3
TURN_ON_BIAS_RAD_S = 5e-3
BIAS_WALK_RAD_S_SQRT_S = 5e-6
SCALE_FACTOR_SD = 0.01  # gyro scale and axis misalignment, of the angle turned
# Assumed: what a person can do while nothing is heard of them.
WALKING_SPEED_M_S = 1.5
TURNING_RATE_RAD_S = 1.0

X, Y, HEADING, BIAS, SCALE, REFERENCE = range(6)


class DriftModel:
    """Covariance of the errors of a dead-reckoned track; (0, 0) and heading 0 at the start are exact by definition."""

    def __init__(self, scale_variance: float) -> None:
        self.covariance: Array = np.diag([0.0, 0.0, 0.0, TURN_ON_BIAS_RAD_S**2, scale_variance, 0.0])

    def pass_time(self, dt_s: float) -> None:
        """The bias turns the heading, the rate noise lets it wander."""
        covariance = self.covariance
        covariance[HEADING] -= dt_s * covariance[BIAS]
        covariance[:, HEADING] -= dt_s * covariance[:, BIAS]
        self.covariance[HEADING, HEADING] += RATE_NOISE_RAD_SQRT_S**2 * dt_s
        self.covariance[BIAS, BIAS] += BIAS_WALK_RAD_S_SQRT_S**2 * dt_s

    def turn(self, angle_rad: float) -> None:
        """A turn of the body adds the error of the gyro's scale."""
        self.covariance[HEADING, HEADING] += (SCALE_FACTOR_SD * angle_rad) ** 2

    def step(self, dx_m: float, dy_m: float, scale: float, along_sd_m: float, across_sd_m: float) -> None:
        """A step by (dx, dy), with its own errors along and across the direction of walking."""
        transition = np.eye(6)
        transition[X, HEADING], transition[Y, HEADING] = -dy_m, dx_m
        transition[X, SCALE], transition[Y, SCALE] = dx_m / scale, dy_m / scale
        self._propagate(transition)
        course_rad = math.atan2(dy_m, dx_m)
        c, s = math.cos(course_rad), math.sin(course_rad)
        axes = np.array([[c, -s], [s, c]])
        self.covariance[:2, :2] += axes @ np.diag([along_sd_m**2, across_sd_m**2]) @ axes.T

    def rescale(self, variance: float) -> None:
        """The step scale was found anew: what it was wrong by stays in the position, the new error is another."""
        forgotten = np.eye(6)
        forgotten[SCALE, SCALE] = 0.0
        self._propagate(forgotten)
        self.covariance[SCALE, SCALE] = variance

    def rest(self) -> float:
        """Learn the bias from a second of rest; the gain in 0..1 with which to pull the estimate to the mean rate.

        Only the bias is corrected: heading and position, though correlated with it, must not jump in odom (REP 105).
        The Joseph form is right for such a gain too.
        """
        variance = self.covariance[BIAS, BIAS]
        gain = float(variance / (variance + MEAN_RATE_SD_RAD_S**2))
        keep = np.eye(6)
        keep[BIAS, BIAS] = 1.0 - gain
        self._propagate(keep)
        self.covariance[BIAS, BIAS] += (gain * MEAN_RATE_SD_RAD_S) ** 2
        return gain

    def refer(self, variance_rad2: float) -> None:
        """A direction seen with this variance is kept for later: its error is that of the heading now, and its own."""
        copied = np.eye(6)
        copied[REFERENCE] = 0.0
        copied[REFERENCE, HEADING] = 1.0
        self._propagate(copied)
        self.covariance[REFERENCE, REFERENCE] += variance_rad2

    def compare(self, off_rad: float, variance_rad2: float, gate_sd: float) -> tuple[float, float, float] | None:
        """The reference is seen again, `off_rad` beside where it was kept; corrections to add to heading, bias, and it.

        None, and nothing learnt, where it is off by more than `gate_sd` deviations. Position and scale are left as they
        are, as in `rest`.
        """
        row = np.zeros(6)
        row[HEADING], row[REFERENCE] = 1.0, -1.0
        expected = float(row @ self.covariance @ row) + variance_rad2
        if off_rad * off_rad > gate_sd**2 * expected:
            return None
        gain = self.covariance @ row / expected
        gain[[X, Y, SCALE]] = 0.0
        self._propagate(np.eye(6) - np.outer(gain, row))
        self.covariance += variance_rad2 * np.outer(gain, gain)
        return -float(gain[HEADING]) * off_rad, -float(gain[BIAS]) * off_rad, -float(gain[REFERENCE]) * off_rad

    def saturation(self, angle_rad: float) -> None:
        """A clipped turn rate: the body may have turned by so much more, always the same way."""
        sd_rad = math.sqrt(self.covariance[HEADING, HEADING])
        self.covariance[HEADING, HEADING] += angle_rad * (angle_rad + 2.0 * sd_rad)

    def gap(self, dt_s: float) -> None:
        """Nothing was measured for dt_s: the person may have walked and turned."""
        self.pass_time(dt_s)
        self.covariance[HEADING, HEADING] += (TURNING_RATE_RAD_S * dt_s) ** 2
        self.covariance[X, X] += (WALKING_SPEED_M_S * dt_s) ** 2
        self.covariance[Y, Y] += (WALKING_SPEED_M_S * dt_s) ** 2

    def _propagate(self, transition: Array) -> None:
        moved = transition @ self.covariance @ transition.T
        self.covariance = 0.5 * (moved + moved.T)
