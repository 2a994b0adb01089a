"""Which way the sensor sits on the body: the front is where the waist is pushed in the rhythm of the steps.

With each step the waist rises and falls once and is pushed forward and held back once; it sways sideways once in two
steps. So of the horizontal acceleration what keeps the rhythm of the steps points along the way of walking, and its
lag behind the vertical acceleration, about a third of a step in everybody, tells front from back.
"""

import cmath
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Lag of the forward acceleration behind the vertical one, at the rhythm of the steps: circular mean over the people of
# ipol_gait_lowerback, who lie between 97° and 132° (bench/pdr_mounting.py).
FORWARD_PHASE_RAD = math.radians(114.0)
# How far the walks of the same people lie off their sensor's nominal front, each person held out: what no number of
# steps averages away, since the sensor sits askew and people's hips are not symmetric.
PEOPLE_SD_RAD = math.radians(5.0)
MEMORY_STEPS = 100  # after which a sensor that slid along the belt is found at its new place
_FEWEST_STEPS = 6
_LARGEST_SD_RAD = math.radians(20.0)


@dataclass(frozen=True, slots=True)
class FrontEstimate:
    """Yaw of the body's front, counter-clockwise from the supposed one, and its variance."""

    yaw_rad: float
    variance_rad2: float


def forward_push(phase_rad: Array, motion_m_s2: Array) -> complex:
    """The push of one step as front + i·left, in (m/s²)².

    `motion_m_s2` (n, 3) is the acceleration without gravity in level axes: x the supposed front, y left of it, z up;
    `phase_rad` (n,) runs through 2π from strike to strike.
    """
    front, left, up = np.exp(-1j * phase_rad) @ motion_m_s2 / len(phase_rad)
    aligned = np.exp(-1j * FORWARD_PHASE_RAD) * np.conj(up)
    return complex((aligned * front).real, (aligned * left).real)


class FrontFinder:
    """Gathers the pushes of the steps, the older the less."""

    def __init__(self) -> None:
        self._sum = 0j
        self._squares = self._count = 0.0

    def add(self, push: complex) -> None:
        """Take the push of one more step."""
        keep = 1.0 - 1.0 / MEMORY_STEPS
        self._sum = keep * self._sum + push
        self._squares = keep * self._squares + abs(push) ** 2
        self._count = keep * self._count + 1.0

    def estimate(self) -> FrontEstimate | None:
        """None while there are too few steps, or they do not agree."""
        if self._count < _FEWEST_STEPS * (1.0 - 0.5 * _FEWEST_STEPS / MEMORY_STEPS) or not self._sum:
            return None
        mean = self._sum / self._count
        scatter = max(self._squares / self._count - abs(mean) ** 2, 0.0)
        own_variance = scatter / (self._count * abs(mean) ** 2)
        if own_variance > _LARGEST_SD_RAD**2:
            return None
        return FrontEstimate(cmath.phase(mean), own_variance + PEOPLE_SD_RAD**2)
