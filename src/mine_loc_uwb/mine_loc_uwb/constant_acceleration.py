"""Motion of the state (p, v, a) of paper D: constant acceleration driven by white jerk, per axis.

p' = v, v' = a, a' = w with spectral density q of w in m²/s⁵: exact for any interval, so rounds may come irregularly.
"""

import numpy as np

from mine_loc_uwb.fix import Array

_UNIT_NOISE = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
_UNIT_ROOT = np.linalg.cholesky(_UNIT_NOISE)


def transition(elapsed_s: float) -> Array:
    """Transition of one axis over an interval, (3, 3)."""
    return np.array([[1.0, elapsed_s, 0.5 * elapsed_s**2], [0.0, 1.0, elapsed_s], [0.0, 0.0, 1.0]])


def noise_root(elapsed_s: float, jerk_density_m2_s5: float) -> Array:
    """Lower triangular root of one axis' process noise over an interval, (3, 3)."""
    scale = np.array([elapsed_s**2.5, elapsed_s**1.5, elapsed_s**0.5]) * np.sqrt(jerk_density_m2_s5)
    return np.asarray(scale[:, None] * _UNIT_ROOT)


def start_covariance(position_m2: Array, speed_sd_m_s: float, acceleration_sd_m_s2: float) -> Array:
    """Covariance (3d, 3d) of a state just begun: a position's (d, d), speed and acceleration unknown but bounded."""
    dimensions = len(position_m2)
    covariance = np.diag(np.repeat([0.0, speed_sd_m_s**2, acceleration_sd_m_s2**2], dimensions))
    covariance[:dimensions, :dimensions] = position_m2
    return covariance
