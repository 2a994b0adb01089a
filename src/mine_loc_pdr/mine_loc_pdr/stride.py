"""Step length from body height, step frequency and the vertical swing of the waist: two models of one interface.

Both have the scale K of the person, found from walks of known length (`stride_calibration.py`).
"""

import math
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.people import Person
from mine_loc_pdr.steps import SLOWEST_STEP_S

Array = NDArray[np.float64]

TYPICAL_HEIGHT_M = 1.75
TYPICAL_FREQUENCY_HZ = 1.79
# Relative error of 20 m walks with K = 1, of twelve people of ipol_gait_lowerback (`python bench/pdr.py --only ipol`):
# paper B's model is 15 % long in the mean, sd 9 %; the pendulum's people differ by 4 % and each one's walks by 3 %.
UNCALIBRATED_SCALE_VARIANCE = 0.13**2
PENDULUM_SCALE_VARIANCE = 0.05**2
PENDULUM_FACTOR = 0.49  # least mean error over the same walks, as is the exponent
SWING_EXPONENT = 0.375
# No one walks with longer steps, by body height; a knock, or a step missed before, must not make one.
LONGEST_STEP_SHARE = 0.6
# Assumed: step to step at constant frequency, no public recording at hand measures single steps.
STEP_TO_STEP_SD_M = 0.06


class StepLengthModel(Protocol):
    """Length of one person's steps. `scale` is K, with the variance of its error, which all their steps share."""

    @property
    def scale(self) -> float:
        """K."""

    @property
    def scale_variance(self) -> float:
        """Of the error of K."""

    def length_m(self, frequency_hz: float | None, swing_m_s2: float) -> float:
        """Length of a step at `frequency_hz` steps a second, None (a first step) counts as the typical frequency;
        `swing_m_s2` is that of the waist's vertical acceleration, as `vertical_swing` finds it.
        """

    def scaled(self, scale: float, variance: float) -> "StepLengthModel":
        """The same with another K."""


@dataclass(frozen=True, slots=True)
class StrideModel:
    """The linear model of paper B, equation 2; `alpha` and `beta` default to the literature's usual values."""

    height_m: float
    alpha: float = 0.371  # height coefficient
    beta: float = 0.227  # step-frequency coefficient, m·s
    scale: float = 1.0
    scale_variance: float = UNCALIBRATED_SCALE_VARIANCE

    def length_m(self, frequency_hz: float | None, swing_m_s2: float = 0.0) -> float:  # noqa: ARG002
        """See StepLengthModel; the swing plays no part."""
        faster_hz = 0.0 if frequency_hz is None else frequency_hz - TYPICAL_FREQUENCY_HZ
        by_height_m = self.alpha * (self.height_m - TYPICAL_HEIGHT_M)
        by_frequency_m = self.beta * faster_hz * self.height_m / TYPICAL_HEIGHT_M
        return (0.7 + by_height_m + by_frequency_m) * self.scale

    def scaled(self, scale: float, variance: float) -> "StrideModel":
        """The same with another K."""
        return replace(self, scale=scale, scale_variance=variance)


@dataclass(frozen=True, slots=True)
class PendulumStrideModel:
    """The waist as the top of an inverted pendulum, nearly: L = c √H · swing^0.375 / SF · K.

    A waist that moves up and down by h on a leg of length l ∝ H makes steps of 2 √(2 l h) (Zijlstra and Hof,
    "Assessment of spatio-temporal gait parameters from trunk accelerations during human walking", Gait & Posture 18,
    2003); for a sine of frequency SF, h ∝ swing / SF². People who bounce more do not go as much further as that: the
    exponent of their swing is a little below the pendulum's 0.5.
    """

    height_m: float
    scale: float = 1.0
    scale_variance: float = PENDULUM_SCALE_VARIANCE
    swing_exponent: float = SWING_EXPONENT

    def length_m(self, frequency_hz: float | None, swing_m_s2: float) -> float:
        """See StepLengthModel."""
        rise = math.sqrt(self.height_m) * math.pow(swing_m_s2, self.swing_exponent)
        lasts_s = min(1.0 / (frequency_hz or TYPICAL_FREQUENCY_HZ), SLOWEST_STEP_S)
        return min(PENDULUM_FACTOR * rise * lasts_s, LONGEST_STEP_SHARE * self.height_m) * self.scale

    def scaled(self, scale: float, variance: float) -> "PendulumStrideModel":
        """The same with another K."""
        return replace(self, scale=scale, scale_variance=variance)


def vertical_swing(phase_rad: Array, up_m_s2: Array) -> float:
    """By how much the vertical acceleration (n,) swings with the steps, from valley to peak, in m/s².

    `phase_rad` (n,) grows by a turn with every step. What is faster than the steps, as the knock of a heel, is no rise
    of the waist and does not count.
    """
    swung: complex = np.mean((up_m_s2 - up_m_s2.mean()) * np.exp(-1j * phase_rad)).item()
    return 4.0 * abs(swung)


def common_variance_m2(model: StepLengthModel, length_m: float) -> float:
    """Variance of a step's length that all steps of the person share, by the error of the scale."""
    return model.scale_variance * (length_m / model.scale) ** 2


def stride_model(person: Person) -> StepLengthModel:
    """The model that people.yaml chooses for a person."""
    stride = person.stride
    if stride.model == "paper_b":
        return StrideModel(person.height_m, stride.alpha, stride.beta, stride.k)
    return PendulumStrideModel(person.height_m, stride.k)
