"""Numbers of a window that tell a turn from straight walking, however the sensor is worn.

A turn to the right is the mirror image of one to the left, so every feature is the same for both. Which of the sets is
used is chosen by cross-validation over people (`activity_training.py`).
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from mine_loc_pdr.activity_window import BINS, ActivityWindow

Array = NDArray[np.float64]
SMOOTHED_BINS = 5  # moving mean of a second, about a stride, over which the pelvis swings to and fro (paper B smooths)
_PROFILE_BINS = 2
_LEAST_SD_M_S2 = 1e-3  # below the noise of any accelerometer


def log_vertical_sd(window: ActivityWindow) -> float:
    """Natural logarithm of the standard deviation of the vertical acceleration in m/s²: how briskly one walks."""
    mean = float(window.vertical_m_s2.mean())
    variance = float(window.square_m2_s4.mean()) - mean * mean
    return math.log(max(math.sqrt(max(variance, 0.0)), _LEAST_SD_M_S2))


def smoothed_heading(window: ActivityWindow) -> Array:
    """Moving mean of the heading, (BINS + 2 - SMOOTHED_BINS,) in rad."""
    return np.convolve(window.heading_rad, np.full(SMOOTHED_BINS, 1.0 / SMOOTHED_BINS), "valid")


def turn(window: ActivityWindow) -> Array:
    """(3,) rad: change of heading from end to end, its greatest between any two instants, the same when smoothed."""
    return np.array([abs(window.turn_rad), np.ptp(window.heading_rad), np.ptp(smoothed_heading(window))])


def profile(window: ActivityWindow) -> Array:
    """(BINS / 2,) rad: change of heading in each 0.4 s, mirrored to a turn to the left."""
    changes = np.diff(window.heading_rad[::_PROFILE_BINS])
    return np.asarray(math.copysign(1.0, window.turn_rad) * changes)


def turn_and_gait(window: ActivityWindow) -> Array:
    """(6,): `turn`; its greatest change in a second (rad); brisk or weak steps overall and in the weakest second."""
    heading = window.heading_rad
    quickest = np.abs(heading[SMOOTHED_BINS:] - heading[:-SMOOTHED_BINS]).max()
    power = window.square_m2_s4.reshape(BINS // SMOOTHED_BINS, SMOOTHED_BINS).mean(axis=1)
    weakest = 0.5 * math.log(max(float(power.min()), _LEAST_SD_M_S2**2))
    return np.array([*turn(window), quickest, log_vertical_sd(window), weakest])


FEATURES: Mapping[str, Callable[[ActivityWindow], Array]] = {
    "turn": turn,
    "profile": profile,
    "turn_and_gait": turn_and_gait,
}


def matrix(name: str, windows: Sequence[ActivityWindow]) -> Array:
    """(n, d) features of set `name`, a row a window."""
    return np.array([FEATURES[name](window) for window in windows])


def width(name: str) -> int:
    """Number of features in set `name`."""
    return len(FEATURES[name](ActivityWindow(0, np.zeros(BINS + 1), np.zeros(BINS), np.zeros(BINS))))
