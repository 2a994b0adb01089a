"""Step length from body height and step frequency: the linear model of paper B, equation 2."""

from dataclasses import dataclass

TYPICAL_HEIGHT_M = 1.75
TYPICAL_FREQUENCY_HZ = 1.79
# The model with K = 1 against 20 m walks of twelve people of ipol_gait_lowerback: 10 % long in the mean, sd 9 %.
UNCALIBRATED_SCALE_VARIANCE = 0.13**2
# Assumed: step to step at constant frequency, no public recording at hand measures single steps.
STEP_TO_STEP_SD_M = 0.06


@dataclass(frozen=True, slots=True)
class StrideModel:
    """Coefficients of one person; `alpha` and `beta` default to the literature's usual values (paper B).

    `scale` is the paper's K, with the variance of its error, which all steps of the person share.
    """

    height_m: float
    alpha: float = 0.371  # height coefficient
    beta: float = 0.227  # step-frequency coefficient, m·s
    scale: float = 1.0
    scale_variance: float = UNCALIBRATED_SCALE_VARIANCE

    def length_m(self, frequency_hz: float | None) -> float:
        """Length of a step at `frequency_hz` steps a second; None (a first step) counts as the typical frequency."""
        faster_hz = 0.0 if frequency_hz is None else frequency_hz - TYPICAL_FREQUENCY_HZ
        by_height_m = self.alpha * (self.height_m - TYPICAL_HEIGHT_M)
        by_frequency_m = self.beta * faster_hz * self.height_m / TYPICAL_HEIGHT_M
        return (0.7 + by_height_m + by_frequency_m) * self.scale

    def common_variance_m2(self, length_m: float) -> float:
        """Variance of a step's length that all steps of the person share, by the error of the scale."""
        return self.scale_variance * (length_m / self.scale) ** 2
