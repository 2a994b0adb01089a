"""From impulse response to DW1000 accumulator: pulse, sub-tap timing, automatic gain, preamble accumulation, noise.

Automatic gain and saturation follow what 7934 real accumulators show (uwb_cirs_2018): the reported level is compressed
above -88 dBm and never exceeds about -78 dBm, and accumulation stops once a component reaches 16384, which is why
RXPACC falls as the signal grows while the peak stays at 16 to 20 thousand counts.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from mine_loc_sim import radio_constants as constants
from mine_loc_sim.channel_15_4a import FINE_PER_TAP, TAP_NS, Taps
from mine_loc_uwb.received_power import reported_level_dbm

_GUARD_TAPS = 8


@dataclass(frozen=True, slots=True)
class Reception:
    """`n` receptions as they stand in the accumulator; all arrays are (n,) unless stated."""

    samples: Taps  # (n, 1016), whole counts in -32768..32767
    symbols: NDArray[np.int64]
    saturated: NDArray[np.bool_]
    direct_index: NDArray[np.float64]  # where delay 0 of the response lies, taps: truth
    full_count: int


@dataclass(frozen=True, slots=True)
class Receiver:
    """Noise of `n` receivers, drawn once for each radio."""

    thermal_counts: NDArray[np.float64]  # rms |z| a root of symbols
    self_noise: NDArray[np.float64]  # share of the root of total energy

    @staticmethod
    def draw(count: int, rng: np.random.Generator) -> "Receiver":
        """Draw radios with the spread seen over real ones."""
        thermal = constants.NOISE_PER_SYMBOL_COUNTS * np.exp(constants.NOISE_FIGURE_LN_SD * rng.standard_normal(count))
        own = constants.SELF_NOISE_RATIO * np.exp(constants.SELF_NOISE_LN_SD * rng.standard_normal(count))
        return Receiver(thermal, own)


def band_limit(taps: Taps) -> Taps:
    """Spectrum of responses (n, bins) behind the pulse, over the band of one sample a tap: (n, length)."""
    length = scipy.fft.next_fast_len(-(-taps.shape[1] // FINE_PER_TAP) + 2 * _GUARD_TAPS)
    spectrum = scipy.fft.fft(taps, length * FINE_PER_TAP, axis=1)
    half = length // 2
    low = np.concatenate([spectrum[:, : length - half], spectrum[:, -half:]], axis=1)
    low *= _raised_cosine(length)
    return np.asarray(low)


def _sample(spectrum: Taps, shift_taps: NDArray[np.float64]) -> Taps:
    """Once a tap, delay 0 at `_GUARD_TAPS + shift_taps`; shift_taps: (n,), 0..1. Returns (n, length)."""
    turn = (-2j * np.pi * scipy.fft.fftfreq(spectrum.shape[1])).astype(np.complex64)
    delayed = spectrum * np.exp(turn * (_GUARD_TAPS + shift_taps[:, None]).astype(np.float32))
    return np.asarray(scipy.fft.ifft(delayed, axis=1, overwrite_x=True), np.complex64)


@cache
def _raised_cosine(length: int) -> NDArray[np.float32]:
    """Spectrum of the received pulse, a raised cosine of full roll-off."""
    frequency = np.abs(scipy.fft.fftfreq(length)) * constants.PULSE_PERIOD_TAPS
    gain = 0.5 * (1.0 + np.cos(np.pi * np.clip(frequency, 0.0, 1.0)))
    return np.asarray(gain, np.float32)


def pulse_peak() -> float:
    """Peak of a lone path of energy 1: raised cosine of roll-off 1 has energy 3/4 of its period."""
    return float(1.0 / np.sqrt(0.75 * constants.PULSE_PERIOD_TAPS))


def accumulate(
    spectrum: Taps,
    peak_delay_taps: NDArray[np.float64],
    level_dbm: NDArray[np.float64],
    receiver: Receiver,
    rng: np.random.Generator,
    *,
    full_count: int = constants.PREAMBLE_COUNT_1024,
) -> Reception:
    """Receive `n` responses with spectra as `band_limit` gives them, each scaled to its true level (n,).

    peak_delay_taps: delay of the strongest path (n,), which pulls the window.
    """
    count = len(spectrum)
    position = rng.uniform(*constants.FIRST_PATH_TAPS, count) - constants.PEAK_PULL * peak_delay_taps
    whole = np.floor(position).astype(int)
    signal = _sample(spectrum, position - whole)
    amplitude = 10.0 ** (0.05 * (reported_level_dbm(level_dbm) + constants.POWER_CONSTANT_DB))
    signal *= (amplitude / np.linalg.norm(signal, axis=1)).astype(np.float32)[:, None]
    strongest = np.maximum(np.abs(signal.real).max(axis=1), np.abs(signal.imag).max(axis=1))
    symbols = np.minimum(np.ceil(constants.ACCUMULATOR_LIMIT / strongest), full_count).astype(int)
    samples = _noise(
        np.hypot(receiver.thermal_counts * np.sqrt(symbols), receiver.self_noise * amplitude * symbols), rng
    )
    index = (whole[:, None] - _GUARD_TAPS + np.arange(signal.shape[1])) % constants.ACCUMULATOR_TAPS
    samples[np.arange(count)[:, None], index] += signal * symbols.astype(np.float32)[:, None]
    np.rint(samples.view(np.float32), out=samples.view(np.float32))
    return Reception(samples, symbols, symbols < full_count, position, full_count)


def _noise(rms_counts: NDArray[np.float64], rng: np.random.Generator) -> Taps:
    """Complex noise over whole accumulators, (n, 1016)."""
    parts = rng.standard_normal((len(rms_counts), constants.ACCUMULATOR_TAPS, 2), np.float32)
    parts *= (rms_counts / np.sqrt(2.0)).astype(np.float32)[:, None, None]
    return parts.view(np.complex64)[..., 0]


def taps_to_m(taps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Accumulator taps as a way [m]."""
    return taps * (TAP_NS * 1e-9 * constants.LIGHT_M_PER_S)
