"""Drawn motions of a waist that takes no step: a rough ride, work with tools, sitting down; to train and to test on."""

import math

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.stamps import NS_PER_S
from mine_loc_pdr.step_frames import CHANNELS, FRAME_NS

Array = NDArray[np.float64]

_FRAME_S = FRAME_NS / NS_PER_S
_SITTING_DEPTH_M = (0.3, 0.5)


def shaking(rng: np.random.Generator, frames: int) -> Array:
    """Frames (frames, CHANNELS) of one of them."""
    draw = (ride, ride, blows, blows, sitting_down)[rng.integers(5)]
    return draw(rng, frames)


def ride(rng: np.random.Generator, frames: int) -> Array:
    """Vibration of a vehicle's seat in a band between 0.5 and 14 Hz, 0.1 to 2.5 m/s² rms, that rocks and turns."""
    low_hz = rng.uniform(0.5, 4.0)
    high_hz = low_hz + rng.uniform(1.0, 10.0)
    motion = np.empty((frames, CHANNELS))
    rms_m_s2 = between(rng, 0.1, 2.5)
    level = rng.uniform(0.1, 0.8)
    for channel, gain in enumerate((1.0, level, level)):
        motion[:, channel] = gain * rms_m_s2 * band_noise(rng, frames, low_hz, high_hz)
    for channel in (3, 4, 5):
        motion[:, channel] = between(rng, 0.01, 0.3) * band_noise(rng, frames, 0.3, high_hz)
    bend_s = rng.uniform(4.0, 20.0)
    motion[:, 3] += rng.normal(0.0, 0.2) * np.sin(math.tau * _times_s(frames) / bend_s + rng.uniform(0.0, math.tau))
    return motion


def blows(rng: np.random.Generator, frames: int) -> Array:
    """Blows of a tool as the waist feels them, 1 to 15 m/s² for 20 to 70 ms, and the swing of the arm between them."""
    times_s = _times_s(frames)
    period_s, width_s = rng.uniform(0.4, 1.8), rng.uniform(0.008, 0.03)
    strength_m_s2 = between(rng, 1.0, 15.0)
    axis = rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    into = strength_m_s2 * np.array(
        [rng.choice([-1.0, 1.0]) * (0.3 + 0.7 * abs(axis[0])), 0.7 * axis[1], 0.7 * axis[2]]
    )
    turn_rad_s = 0.02 * strength_m_s2 * rng.standard_normal(3)
    motion = np.zeros((frames, CHANNELS))
    at_s = rng.uniform(0.0, period_s)
    while at_s < times_s[-1]:
        knock = np.exp(-0.5 * ((times_s - at_s) / width_s) ** 2)
        back = -rng.uniform(0.0, 0.5) * np.exp(-0.5 * ((times_s - at_s - 3.0 * width_s) / (1.5 * width_s)) ** 2)
        motion += np.outer(rng.uniform(0.7, 1.3) * (knock + back), np.concatenate((into, turn_rad_s)))
        at_s += period_s * rng.uniform(0.85, 1.15)
    swing, phase = rng.uniform(0.0, 0.5), rng.uniform(0.0, math.tau)
    for channel in (0, 1, 3):
        motion[:, channel] += swing * np.sin(math.tau * times_s / period_s + phase + channel)
    motion[:, 0] -= motion[:, 0].mean()
    return motion


def sitting_down(rng: np.random.Generator, frames: int) -> Array:
    """One smooth way down, or up, of 0.8 to 2.2 s, with the trunk leaning into it."""
    lasts = round(rng.uniform(0.8, 2.2) / _FRAME_S)
    first = int(rng.integers(max(1, frames - lasts)))
    s = np.arange(min(lasts, frames - first)) / lasts
    depth_m = rng.choice([-1.0, 1.0]) * rng.uniform(*_SITTING_DEPTH_M)
    motion = np.zeros((frames, CHANNELS))
    within = slice(first, first + len(s))
    motion[within, 0] = -depth_m / (lasts * _FRAME_S) ** 2 * (60.0 * s - 180.0 * s**2 + 120.0 * s**3)
    motion[within, 1] = rng.standard_normal() * np.sin(math.tau * s)
    motion[within, 4] = rng.standard_normal() * np.sin(math.pi * s) ** 2
    return motion


def band_noise(rng: np.random.Generator, frames: int, low_hz: float, high_hz: float) -> Array:
    """Gaussian noise (frames,) of one band, rms 1."""
    hz = np.fft.rfftfreq(frames, _FRAME_S)
    waves = ((hz >= low_hz) & (hz <= high_hz)) * (rng.standard_normal(len(hz)) + 1j * rng.standard_normal(len(hz)))
    noise: Array = np.fft.irfft(waves, frames)
    noise *= 1.0 / noise.std()
    return noise


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """Drawn evenly in the logarithm."""
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def _times_s(frames: int) -> Array:
    return np.arange(frames, dtype=np.float64) * _FRAME_S
