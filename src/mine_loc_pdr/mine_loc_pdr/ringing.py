"""Drawn ringing of a loosely worn sensor: heel strikes set it off, in whatever direction its pouch gives way."""

import math

import numpy as np
from numpy.typing import NDArray

from mine_loc_pdr.shaking import between

Array = NDArray[np.float64]


def ringing(rng: np.random.Generator, times_s: Array, strikes_s: Array) -> Array:
    """Acceleration (n, 3) at times (n,) in m/s²: 4 to 14 Hz, 0.5 to 8 m/s², alike after each strike.

    It decays within 0.05 to 1.5 s, so that it may last from strike to strike, and may change its sign with the foot.
    """
    frequency_hz, strength_m_s2, decay_s = between(rng, 4.0, 14.0), between(rng, 0.5, 8.0), between(rng, 0.05, 1.5)
    phase_rad, other_foot = rng.uniform(0.0, math.tau), rng.choice([-1.0, 1.0])
    direction = rng.standard_normal(3)
    direction *= strength_m_s2 / np.linalg.norm(direction)
    strikes = np.concatenate(([-np.inf], np.sort(strikes_s)))
    number = np.searchsorted(strikes, times_s, side="right") - 1
    since_s = np.where(number > 0, times_s - strikes[number], np.inf)
    decayed = np.exp(-since_s / decay_s) * other_foot**number
    wave = decayed * np.cos(math.tau * frequency_hz * np.minimum(since_s, 100.0 * decay_s) + phase_rad)
    return np.outer(wave, direction)
