"""Gates stated as a probability."""

import functools
import math


@functools.cache
def chi2_quantile(probability: float, degrees_of_freedom: int) -> float:
    """Value that a χ² variable stays below with this probability: the threshold of a Mahalanobis gate."""
    if not 0.0 < probability < 1.0:
        raise ValueError(f"probability {probability} is not within (0, 1)")
    if degrees_of_freedom == 2:
        return -2.0 * math.log1p(-probability)
    from scipy.special import gammaincinv  # noqa: PLC0415 a third of a second that a restarted node does not have

    return float(2.0 * gammaincinv(degrees_of_freedom / 2.0, probability))
