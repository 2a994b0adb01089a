"""The arithmetic of velocity changes in the `tightly_coupled` filter: what an accelerometer says between ranges.

Own states of the filter, behind what its ranges have in common (`mine_loc_uwb.tracker_kernel`), d = 2 or 3 of the map:

    cosine, sine of the yaw of odom while it is unknown; velocity at the change before (d); error of acceleration (d)

A change measures the difference of two velocities (stochastic cloning, as a step measures that of two places). While
the yaw is unknown it stands in the filter as cosine and sine, of variance 1/2 each before anything is known: horizontal
changes are linear in them, so that no first guess is needed. The error of acceleration is that of the horizon (g times
the tilt) and of the sensor, a Gauss–Markov process.
"""

import math

import numpy as np
from numba import njit

from mine_loc_fusion import step_kernel
from mine_loc_fusion.estimate import Array
from mine_loc_fusion.step_kernel import OWN_STATES, YAW

COSINE, SINE, VELOCITY = range(3)
"""Places of the own states, from the first of them on; the error of acceleration begins d behind VELOCITY."""


def inertial_states(dimensions: int) -> int:
    """How many the own states are."""
    return VELOCITY + 2 * dimensions


@njit(cache=True)
def forget_yaw(x: Array, P: Array, dimensions: int) -> None:
    """Nothing is known of the yaw: its cosine and sine have mean 0 and variance 1/2."""
    for state in (2 * dimensions + 1 + COSINE, 2 * dimensions + 1 + SINE):
        x[state] = 0.0
        P[state, :] = 0.0
        P[:, state] = 0.0
        P[state, state] = 0.5


@njit(cache=True)
def begin(x: Array, P: Array, dimensions: int, error_sd_m_s2: Array) -> None:
    """Of the error of acceleration (3,) it is known how large it is, of the yaw nothing."""
    forget_yaw(x, P, dimensions)
    own = 2 * dimensions + 1
    for axis in range(dimensions):
        error = own + VELOCITY + dimensions + axis
        P[error, error] = error_sd_m_s2[axis] ** 2


@njit(cache=True)
def pass_time(x: Array, P: Array, dimensions: int, gone_s: float, error_sd_m_s2: Array, error_time_s: Array) -> None:
    """The error of acceleration (3,) returns to 0 with its time constants (3,)."""
    for axis in range(dimensions):
        error = 2 * dimensions + 1 + VELOCITY + dimensions + axis
        fade = math.exp(-gone_s / error_time_s[axis])
        x[error] *= fade
        P[error, :] *= fade
        P[:, error] *= fade
        P[error, error] += error_sd_m_s2[axis] ** 2 * (1.0 - fade * fade)


@njit(cache=True)
def remember_velocity(x: Array, P: Array, dimensions: int) -> None:
    """Let the clone be the velocity now."""
    step_kernel.clone(x, P, dimensions, 2 * dimensions + 1 + VELOCITY, dimensions)


@njit(cache=True)
def take_velocity_change(
    x: Array,
    P: Array,
    dimensions: int,
    first_link: int,
    yaw_known: int,
    change_m_s: Array,
    interval_s: float,
    variance_m2_s2: float,
    gate: float,
) -> float:
    """Update (x, P) by a change of velocity (3,) in odom; returns the squared Mahalanobis distance (d degrees).

    velocity − clone = R(yaw) change + error · interval + noise; `yaw_known` = 1 says that R is of the yaw that steps
    use, else it is of cosine and sine. Components are taken one after the other, each with R of the state by then;
    beyond `gate` nothing changes.
    """
    d, own = dimensions, 2 * dimensions + 1
    yaw, before, slope = first_link - OWN_STATES + YAW, own + VELOCITY, own + VELOCITY + d
    new_x, new_P, H, distance_sq = x.copy(), P.copy(), np.zeros(len(x)), 0.0
    for axis in range(d):
        c, s = (
            (math.cos(new_x[yaw]), math.sin(new_x[yaw])) if yaw_known > 0 else (new_x[own + COSINE], new_x[own + SINE])
        )
        along, across, H[:] = change_m_s[2], 0.0, 0.0
        if axis < 2:
            east, north = (change_m_s[0], change_m_s[1]) if axis == 0 else (change_m_s[1], -change_m_s[0])
            along, across = c * east - s * north, s * east + c * north
            if yaw_known > 0:
                H[yaw] = across
            else:
                H[own + COSINE], H[own + SINE] = -east, north
        H[d + axis], H[before + axis], H[slope + axis] = 1.0, -1.0, -interval_s
        error = along + new_x[slope + axis] * interval_s - new_x[d + axis] + new_x[before + axis]
        gain = new_P @ H
        variance = float(H @ gain) + variance_m2_s2
        distance_sq += error * error / variance
        for i in range(len(x)):
            new_x[i] += gain[i] * error / variance
            for j in range(i + 1):
                new_P[i, j] -= gain[i] * gain[j] / variance
                new_P[j, i] = new_P[i, j]
    if distance_sq <= gate:
        x[:], P[:] = new_x, new_P
    return distance_sq


@njit(cache=True)
def settle_yaw(x: Array, P: Array, dimensions: int, first_link: int) -> None:
    """Let the yaw be the angle of its cosine and sine."""
    own, yaw = 2 * dimensions + 1, first_link - OWN_STATES + YAW
    c, s = x[own + COSINE], x[own + SINE]
    square = c * c + s * s
    x[yaw] = math.atan2(s, c)
    P[yaw, :] = (c * P[own + SINE, :] - s * P[own + COSINE, :]) / square
    P[:, yaw] = P[yaw, :]
    P[yaw, yaw] = (c * P[yaw, own + SINE] - s * P[yaw, own + COSINE]) / square
