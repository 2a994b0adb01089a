"""Curves of time as uniform quintic B-splines: every derivative up to the fourth is continuous and exact.

Control points are used as they are, not interpolated: corners come out rounded, noise band-limited, and a curve never
leaves the convex hull of its control points (de Boor, A Practical Guide to Splines, ch. IX), so a path drawn inside a
gallery stays inside it.
"""

import math

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline, PPoly

Array = npt.NDArray[np.float64]
DEGREE = 5
# A white sequence of control points at spacing h gives a second derivative whose spectrum peaks at PEAK / h:
# the maximum of f⁴ sinc¹²(f h), to second order.
PEAK = 1.0 / np.pi


class SmoothCurve:
    """A curve (m columns) with control point i at `start_s + i * spacing_s`; constant beyond both ends."""

    def __init__(self, start_s: float, spacing_s: float, controls: Array) -> None:
        padded = np.pad(controls, ((DEGREE + 1, DEGREE + 1), (0, 0)), mode="edge")
        knots = start_s + spacing_s * (np.arange(len(padded) + DEGREE + 1) - DEGREE - 1 - (DEGREE + 1) / 2)
        self._low, self._high = knots[DEGREE], knots[-DEGREE - 1]
        curve = _piecewise(BSpline(knots, padded, DEGREE))
        self._derivatives = (curve, curve.derivative(1), curve.derivative(2))

    def __call__(self, t_s: Array, derivative: int = 0) -> Array:
        """Value or derivative (0, 1, 2) at the instants `t_s` (n,), as (n, m)."""
        values: Array = self._derivatives[derivative](np.clip(t_s, self._low, self._high))
        return values


def _piecewise(spline: BSpline) -> PPoly:
    """The same curve as a polynomial a segment (Taylor's, at its beginning), which is evaluated faster."""
    borders = spline.t[DEGREE:-DEGREE]
    powers = range(DEGREE, -1, -1)
    return PPoly(np.stack([spline(borders[:-1], nu=power) / math.factorial(power) for power in powers]), borders)


def white_control_gain(derivative: int) -> float:
    """Standard deviation of a curve's derivative over spacing**-derivative, for white controls of unit deviation."""
    impulse = np.zeros((13, 1))
    impulse[6] = 1.0
    offsets = np.arange(-3.0, 3.0, 0.05)
    response = SmoothCurve(-6.0, 1.0, impulse)(offsets, derivative)[:, 0]
    return float(np.sqrt(np.sum(response**2) * 0.05))
