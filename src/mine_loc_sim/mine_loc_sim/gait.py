"""How one person walks: cadence and step length, step by step, and the waist's periodic motion about the path.

The waist moves as a Fourier series of the stride's phase (0 at a left, π at a right heel strike), whose terms are
those of real strides (`gait_constants`); the phase and the series' gains are splines of time through the steps.
"""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mine_loc_sim import gait_constants as gc
from mine_loc_sim.smooth_curve import PEAK, SmoothCurve, white_control_gain

Array = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]
CHANNELS = 6  # forward, left, up [m], roll, pitch, yaw [rad]


@dataclass(frozen=True, slots=True)
class StepLaw:
    """Paper B's step length law, SL = [0.7 + α(H − 1.75) + β(SF − 1.79) H / 1.75] K (its eq. for the linear model)."""

    height_m: float
    alpha: float
    beta: float
    stride_factor: float

    def _intercept(self) -> float:
        return 0.7 + self.alpha * (self.height_m - 1.75) - 1.79 * self.slope_m_s

    @property
    def slope_m_s(self) -> float:
        """Change of step length with step frequency, before the factor K."""
        return self.beta * self.height_m / 1.75

    def length_m(self, frequency_hz: Array) -> Array:
        """Step length at a step frequency."""
        length: Array = (self._intercept() + self.slope_m_s * frequency_hz) * self.stride_factor
        return length

    def frequency_hz(self, speed_m_s: Array) -> Array:
        """Step frequency at a walking speed: the root of speed = SF · SL(SF), not below the least cadence.

        Slower than that, people shorten their steps instead.
        """
        a, b = self.slope_m_s * self.stride_factor, self._intercept() * self.stride_factor
        root = (np.sqrt(b * b + 4 * a * speed_m_s) - b) / (2 * a)
        frequency: Array = np.maximum(root, gc.MIN_STEP_FREQUENCY_HZ)
        return frequency


@dataclass(frozen=True, slots=True, eq=False)
class Person:
    """One person's way of walking.

    `harmonics` (STRIDE_HARMONICS, 6) are complex amplitudes of the waist's displacement [m] and angles [rad] at
    `reference_frequency_hz` steps a second; `step_time_asymmetry` is the share by which left steps last longer.
    """

    height_m: float
    preferred_speed_m_s: float
    law: StepLaw
    harmonics: ComplexArray
    reference_frequency_hz: float
    step_time_asymmetry: float
    step_time_cv: float
    step_length_cv: float

    @property
    def waist_height_m(self) -> float:
        """Height of the sensor above the ground."""
        return gc.WAIST_SHARE_OF_HEIGHT * self.height_m


def draw_person(
    rng: np.random.Generator,
    height_m: float | None = None,
    stride_factor: float | None = None,
    preferred_speed_m_s: float | None = None,
) -> Person:
    """Draw a person from the population of `gait_constants`; what is given is kept."""

    def drawn(given: float | None, mean: float, deviation: float) -> float:
        value = mean + deviation * float(np.clip(rng.standard_normal(), -2.5, 2.5))
        return value if given is None else given

    height = drawn(height_m, gc.HEIGHT_M, gc.HEIGHT_SD_M)
    speed = drawn(preferred_speed_m_s, gc.PREFERRED_SPEED_M_S, gc.PREFERRED_SPEED_SD_M_S)
    usual_factor = gc.STRIDE_FACTOR + gc.STRIDE_FACTOR_PER_SPEED * (speed - gc.PREFERRED_SPEED_M_S)
    law = StepLaw(height, gc.ALPHA, gc.BETA, drawn(stride_factor, usual_factor, gc.STRIDE_FACTOR_SD))
    frequency = float(law.frequency_hz(np.array(gc.REFERENCE_SPEED_M_S)))
    return Person(
        height_m=height,
        preferred_speed_m_s=speed,
        law=law,
        harmonics=_draw_harmonics(rng, frequency),
        reference_frequency_hz=frequency,
        step_time_asymmetry=gc.STEP_TIME_ASYMMETRY_SD * float(rng.standard_normal()),
        step_time_cv=gc.STEP_TIME_CV,
        step_length_cv=gc.STEP_LENGTH_CV,
    )


def _draw_harmonics(rng: np.random.Generator, step_frequency_hz: float) -> ComplexArray:
    """Complex displacement and angle amplitudes: the population's, scattered as its people are."""
    k = np.arange(1, gc.STRIDE_HARMONICS + 1)
    series = np.zeros((gc.STRIDE_HARMONICS, CHANNELS), dtype=np.complex128)
    for c, channel in enumerate(gc.CHANNELS):
        gain = math.exp(gc.GAIN_LOG_SD[c] * rng.standard_normal())
        regular = k % 2 == (1 if channel.mirrors else 0)
        n = len(channel.amplitude)
        amplitude = np.array(channel.amplitude) * np.exp(np.array(channel.amplitude_log_sd) * rng.standard_normal(n))
        phase = np.array(channel.phase_rad) + np.array(channel.phase_sd_rad) * rng.standard_normal(n)
        series[regular, c] = gain * amplitude * np.exp(1j * phase)
        limp = np.array(channel.asymmetric_amplitude) * np.exp(gc.ASYMMETRIC_LOG_SD * rng.standard_normal(n))
        series[~regular, c] = gain * limp * np.exp(2j * np.pi * rng.random(n))
    omega = np.pi * step_frequency_hz * k
    series[:, :3] /= -(omega[:, None] ** 2)  # acceleration → displacement
    series[:, 3:] /= 1j * omega[:, None]  # rate → angle
    return series


@dataclass(frozen=True, slots=True)
class Sway:
    """Motion in the waist's heading frame at n instants: values (n, 6) and their first two derivatives in time."""

    value: Array
    rate: Array
    acceleration: Array

    def __add__(self, other: "Sway") -> "Sway":
        return Sway(self.value + other.value, self.rate + other.rate, self.acceleration + other.acceleration)


def periodic_motion(
    harmonics: ComplexArray, phase: tuple[Array, Array, Array], gain: tuple[Array, Array, Array]
) -> Sway:
    """Waist motion of gain(t) · Re Σ harmonics_k exp(i k φ(t)).

    `phase` is φ and its two derivatives, (n,) each; `gain` the channels' gains and their derivatives, (n, 6) each.
    """
    k = np.arange(1, len(harmonics) + 1)[:, None]
    stack = np.hstack([harmonics, 1j * k * harmonics, -(k**2) * harmonics])
    powers = np.empty((len(harmonics), len(phase[0])), dtype=np.complex128)
    powers[0] = np.exp(1j * phase[0])
    for i in range(1, len(powers)):
        np.multiply(powers[i - 1], powers[0], out=powers[i])  # far cheaper than so many sines
    shape = (stack.T @ powers).real.T
    s, s1, s2 = shape[:, :CHANNELS], shape[:, CHANNELS : 2 * CHANNELS], shape[:, 2 * CHANNELS :]
    p1, p2 = phase[1][:, None], phase[2][:, None]
    g, g1, g2 = gain
    shape_rate = s1 * p1
    return Sway(g * s, g1 * s + g * shape_rate, g2 * s + 2 * g1 * shape_rate + g * (s2 * p1**2 + s1 * p2))


class IrregularMotion:
    """Random waist motion with exact derivatives: what of real walking or standing does not repeat.

    `deviation` (m, 6), one row a control point, are deviations of acceleration [m/s²] (3) and angular rate [rad/s] (3).
    """

    def __init__(self, rng: np.random.Generator, peak_hz: float, deviation: Array) -> None:
        self._spacing_s = PEAK / peak_hz
        gains = [white_control_gain(2) / self._spacing_s**2] * 3 + [white_control_gain(1) / self._spacing_s] * 3
        controls = rng.standard_normal(deviation.shape) * deviation / np.array(gains)
        self._curve = SmoothCurve(0.0, self._spacing_s, controls)

    def at(self, t_s: Array) -> Sway:
        """Motion at instants (n,) in s."""
        return Sway(self._curve(t_s), self._curve(t_s, 1), self._curve(t_s, 2))


def control_instants_s(peak_hz: float, duration_s: float) -> Array:
    """Where the control points of an IrregularMotion of this peak frequency lie."""
    spacing = PEAK / peak_hz
    instants: Array = spacing * np.arange(math.ceil(duration_s / spacing) + 1, dtype=np.float64)
    return instants
