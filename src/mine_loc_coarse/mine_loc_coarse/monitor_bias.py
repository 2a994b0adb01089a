"""The constant bearing error of each monitor, learnt from emitters that three monitors or more hear.

Each window gives a least squares problem in the biases once positions and velocities are eliminated (a Schur
complement). How large biases are at a place is not known beforehand: a set of spreads is weighed by the evidence that
the bearings give for each, so a place with true monitors is left alone (empirical Bayes, MacKay 1992).
Windows are learnt from one after the other and never overlap, since each report may count once only.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mine_loc_coarse.emitter_fit import Bearings, Fits
from mine_loc_coarse.open_reports import Reports

Array = NDArray[np.float64]
_SPREADS_RAD = np.radians([0.5, 1.0, 2.0])
_PRIOR = (1e-8, 1e-8, 4.0, 4.0)
"""Information on an emitter's place [1/m²] and velocity [s²/m²] beside its bearings: 10 km, and a walker's 0.5 m/s."""
_PRIOR_OF_NONE = 0.8
_LARGEST_RAD = 2.0 * _SPREADS_RAD[-1]
"""More is no bias but a monitor that was turned: it must be aligned, and its bearings fit nowhere until then."""
_LEAST_FILLED, _FILLED = 0.5, 0.9
"""A window teaches as soon as it is half full, and what it taught is kept when it is full."""
_WELL_FITTED = 2.0
"""An emitter whose residuals are so many times the noise is no emitter to learn from, but a wrong pairing."""
_WELL_PLACED_M = 200.0
"""Nor is one whose place is less sure: nearly collinear bearings are not linear in the place."""
_FORGETTING = 0.98
"""Of what was learnt, so much stays a window: a monitor that is knocked over is learnt anew within an hour."""


class MonitorBias:
    """Biases `mean_rad` (m,) of m monitors, reported minus true yaw; 0 as long as there is no evidence of any."""

    def __init__(self, monitors: int, azimuth_sd_rad: float) -> None:
        self._sd_rad = azimuth_sd_rad
        self._information = np.zeros((monitors, monitors))
        self._vector = np.zeros(monitors)
        self._learnt_to_ns = -(2**62)
        self.mean_rad = np.zeros(monitors)

    def corrected(self, reports: Reports) -> Reports:
        """The reports with the biases taken off."""
        return replace(reports, azimuth_rad=reports.azimuth_rad - self.mean_rad[reports.monitor])

    def learn(self, bearings: Bearings, fits: Fits, now_ns: int, window_ns: int) -> None:
        """Work out the biases with the bearings that `fits` fitted, and keep them once a window.

        The bearings were corrected by `mean_rad`. Between two windows that are kept, the present one counts
        provisionally where none of its reports was kept before.
        """
        filled_ns = bearings.age_s.max(initial=0.0) * 1e9
        if now_ns - window_ns < self._learnt_to_ns or filled_ns < _LEAST_FILLED * window_ns:
            return
        information, vector = _reduced(bearings, fits, self._sd_rad, len(self.mean_rad))
        vector = vector + information @ self.mean_rad
        self._mix(self._information + information, self._vector + vector)
        if filled_ns >= _FILLED * window_ns:
            self._information = _FORGETTING * self._information + information
            self._vector = _FORGETTING * self._vector + vector
            self._learnt_to_ns = now_ns

    def _mix(self, information: Array, vector: Array) -> None:
        """Posterior mean over the spreads, each weighed by its evidence, and over there being no bias."""
        values, axes = np.linalg.eigh((information + information.T) / 2.0)
        values, seen = np.maximum(values, 0.0), axes.T @ vector
        gain = 1.0 / (values + _SPREADS_RAD[:, None] ** -2)
        evidence = 0.5 * np.sum(seen**2 * gain - np.log1p(values * _SPREADS_RAD[:, None] ** 2), axis=1)
        logs = np.append(evidence + np.log((1.0 - _PRIOR_OF_NONE) / len(_SPREADS_RAD)), np.log(_PRIOR_OF_NONE))
        weight = np.exp(logs - logs.max())
        weight /= weight.sum()
        self.mean_rad = np.clip(axes @ (weight[:-1] @ (gain * seen)), -_LARGEST_RAD, _LARGEST_RAD)


def _reduced(bearings: Bearings, fits: Fits, sd_rad: float, monitors: int) -> tuple[Array, Array]:
    """Information matrix (m, m) and vector (m,) of the biases, the emitters eliminated.

    With residuals r, derivatives J, and S the covariance of an emitter, each emitter adds
    Σ over its bearings e_i e_iᵀ/σ² − G S Gᵀ, where G (m, 4) sums J/σ² by monitor, and to the vector
    Σ r e_i/σ² − G S Σ J r/σ²: what a shift of the emitter explains is no bias.
    """
    k = len(fits.state)
    squares = np.bincount(bearings.emitter, fits.residual_rad**2, k)
    good = squares <= (_WELL_FITTED * sd_rad) ** 2 * np.bincount(bearings.emitter, minlength=k)
    good &= np.trace(fits.covariance[:, :2, :2], axis1=1, axis2=2) <= _WELL_PLACED_M**2
    scale = np.where(good[bearings.emitter], sd_rad**-2, 0.0)
    summed = np.zeros((monitors, k, 4))
    np.add.at(summed, (bearings.monitor, bearings.emitter), fits.jacobian * scale[:, None])
    # Of these very derivatives, not of the fit's last but one: else the difference below may be negative and run away.
    outer = fits.jacobian[:, :, None] * fits.jacobian[:, None, :] * scale[:, None, None]
    normal = np.zeros((k, 4, 4)) + np.diag(_PRIOR)
    np.add.at(normal, bearings.emitter, outer)
    eliminated = np.linalg.inv(normal)
    explained = (summed.transpose(1, 0, 2) @ eliminated).transpose(1, 0, 2).reshape(monitors, -1)
    information = np.diag(np.bincount(bearings.monitor, scale, monitors)) - explained @ summed.reshape(monitors, -1).T
    scaled = fits.residual_rad * scale
    pull = np.stack([np.bincount(bearings.emitter, scaled * fits.jacobian[:, c], k) for c in range(4)], axis=1)
    vector = np.bincount(bearings.monitor, scaled, monitors) - explained @ pull.reshape(-1)
    return information, vector
