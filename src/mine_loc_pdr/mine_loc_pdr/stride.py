"""Step length from body height, step frequency and the vertical swing of the waist: two models of one interface.

Both have the scale K of the person, found from walks of known length (`stride_calibration.py`).
"""

import math
from dataclasses import dataclass, replace
from typing import Protocol

from mine_loc_core.people import Person
from mine_loc_pdr.steps import SLOWEST_STEP_S

TYPICAL_HEIGHT_M = 1.75
TYPICAL_FREQUENCY_HZ = 1.79
# Relative error of 20 m walks with K = 1, of twelve people of ipol_gait_lowerback (`python bench/pdr.py --only ipol`):
# paper B's model is 10 % long in the mean, sd 9 %; the pendulum's people differ by 5 %, each held out in turn.
UNCALIBRATED_SCALE_VARIANCE = 0.13**2
PENDULUM_SCALE_VARIANCE = 0.06**2
PENDULUM_FACTOR = 0.42  # least squares over the same walks
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
        `swing_m_s2` is the vertical acceleration of the waist from valley to peak.
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
    """The waist as the top of an inverted pendulum: L = c √(H · swing) / SF · K.

    A waist that moves up and down by h on a leg of length l ∝ H makes steps of 2 √(2 l h) (Zijlstra and Hof,
    "Assessment of spatio-temporal gait parameters from trunk accelerations during human walking", Gait & Posture 18,
    2003); for a sine of frequency SF, h ∝ swing / SF².
    """

    height_m: float
    scale: float = 1.0
    scale_variance: float = PENDULUM_SCALE_VARIANCE

    def length_m(self, frequency_hz: float | None, swing_m_s2: float) -> float:
        """See StepLengthModel."""
        rise = math.sqrt(self.height_m * swing_m_s2)
        lasts_s = min(1.0 / (frequency_hz or TYPICAL_FREQUENCY_HZ), SLOWEST_STEP_S)
        return min(PENDULUM_FACTOR * rise * lasts_s, LONGEST_STEP_SHARE * self.height_m) * self.scale

    def scaled(self, scale: float, variance: float) -> "PendulumStrideModel":
        """The same with another K."""
        return replace(self, scale=scale, scale_variance=variance)


def common_variance_m2(model: StepLengthModel, length_m: float) -> float:
    """Variance of a step's length that all steps of the person share, by the error of the scale."""
    return model.scale_variance * (length_m / model.scale) ** 2


def stride_model(person: Person) -> StepLengthModel:
    """The model that people.yaml chooses for a person."""
    stride = person.stride
    if stride.model == "paper_b":
        return StrideModel(person.height_m, stride.alpha, stride.beta, stride.k)
    return PendulumStrideModel(person.height_m, stride.k)
