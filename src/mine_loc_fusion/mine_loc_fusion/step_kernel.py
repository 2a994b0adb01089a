"""The arithmetic of steps in the `tightly_coupled` filter: the way since the step before, as one measurement.

Own states of the filter, before the biases of links (`mine_loc_uwb.tracker_kernel`): the yaw of the odom frame in the
map, the relative error of the step length, and where the person was at the heel strike before (stochastic cloning:
Roumeliotis and Burdick, ICRA 2002), so that a step measures a difference of two positions and nothing is assumed of the
speed within it.
"""

import math

import numpy as np
from numba import njit

from mine_loc_fusion.estimate import Array

YAW, SCALE, STRIKE_X, STRIKE_Y, OWN_STATES = range(5)
"""Places of the own states, and how many they are."""


_ROUNDING = 1e-12
"""Of a variance before, what the difference of two as large may be off by: no place says more than that."""


@njit(cache=True)
def drift(P: Array, first_link: int, yaw_variance_rad2: float, scale_variance: float) -> None:
    """What time adds to the yaw of odom and to the step length's error."""
    own = first_link - OWN_STATES
    P[own + YAW, own + YAW] += yaw_variance_rad2
    P[own + SCALE, own + SCALE] += scale_variance


@njit(cache=True)
def clone(x: Array, P: Array, first: int, copy: int, count: int) -> None:
    """Let `count` states from `copy` on be those from `first` on as they are now (stochastic cloning)."""
    for axis in range(count):
        x[copy + axis] = x[first + axis]
        P[copy + axis, :] = P[first + axis, :]
    for axis in range(count):
        P[:, copy + axis] = P[:, first + axis]


@njit(cache=True)
def remember_strike(x: Array, P: Array, first_link: int) -> None:
    """Let the clone be the position now."""
    clone(x, P, 0, first_link - OWN_STATES + STRIKE_X, 2)


@njit(cache=True)
def allow_turn(P: Array, dimensions: int, turning_s: float, density_m2_s3: float) -> None:
    """Add to P what a horizontal white acceleration of this density would have, had it acted for this time."""
    q = density_m2_s3 * turning_s
    for p in range(2):
        v = dimensions + p
        P[p, p] += q * turning_s * turning_s / 3.0
        P[p, v] += q * turning_s / 2.0
        P[v, p] += q * turning_s / 2.0
        P[v, v] += q


@njit(cache=True)
def take_step(
    x: Array,
    P: Array,
    first_link: int,
    length_m: float,
    heading_rad: float,
    along_variance_m2: float,
    across_variance_m2: float,
    gate: float,
) -> float:
    """Update (x, P) by a step; returns the squared Mahalanobis distance (2 degrees of freedom).

    position − strike = (1 + scale) length (cos, sin)(heading + yaw) + noise along and across. Beyond `gate` nothing
    changes.
    """
    size, own = len(x), first_link - OWN_STATES
    yaw, scale, strike = own + YAW, own + SCALE, own + STRIKE_X
    c, s = math.cos(heading_rad + x[yaw]), math.sin(heading_rad + x[yaw])
    way = (1.0 + x[scale]) * length_m
    H = np.zeros((2, size))
    for axis in range(2):
        H[axis, axis], H[axis, strike + axis] = 1.0, -1.0
    H[0, yaw], H[1, yaw] = way * s, -way * c
    H[0, scale], H[1, scale] = -length_m * c, -length_m * s
    error = np.array([way * c - x[0] + x[strike], way * s - x[1] + x[strike + 1]])
    HP = H @ P
    S = HP @ H.T
    S[0, 0] += along_variance_m2 * c * c + across_variance_m2 * s * s
    S[1, 1] += along_variance_m2 * s * s + across_variance_m2 * c * c
    S[0, 1] += (along_variance_m2 - across_variance_m2) * c * s
    S[1, 0] = S[0, 1]
    return correct(x, P, HP, S, error, gate)


@njit(cache=True)
def take_place(x: Array, P: Array, place_m: Array, covariance_m2: Array, gate: float) -> float:
    """Update (x, P) by a horizontal position (2,); returns the squared Mahalanobis distance, beyond `gate` no more."""
    HP = P[:2, :].copy()
    S = HP[:, :2] + covariance_m2
    for axis in range(2):
        S[axis, axis] += _ROUNDING * (P[0, 0] + P[1, 1])
    return correct(x, P, HP, S, place_m - x[:2], gate)


@njit(cache=True)
def correct(x: Array, P: Array, HP: Array, S: Array, error: Array, gate: float) -> float:
    """Kalman update by a measurement of two components, given H P (2, n), S (2, 2) and the innovation (2,)."""
    determinant = S[0, 0] * S[1, 1] - S[0, 1] * S[1, 0]
    a, b, c = S[1, 1] / determinant, -S[0, 1] / determinant, S[0, 0] / determinant
    distance_sq = a * error[0] ** 2 + 2.0 * b * error[0] * error[1] + c * error[1] ** 2
    if not distance_sq <= gate:
        return float(distance_sq)
    for i in range(len(x)):
        first, second = a * HP[0, i] + b * HP[1, i], b * HP[0, i] + c * HP[1, i]
        x[i] += first * error[0] + second * error[1]
        for j in range(i + 1):
            P[i, j] -= first * HP[0, j] + second * HP[1, j]
            P[j, i] = P[i, j]
    return float(distance_sq)
