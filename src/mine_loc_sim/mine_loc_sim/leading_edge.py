"""Leading-edge detection on a DW1000 accumulator, and the receive registers that follow from it.

The first sample past the noise threshold is followed up to its local maximum; the first path is where the edge passes
half of that height. Decawave does not publish its algorithm: this rule reproduces the FP_INDEX of real accumulators
(uwb_cirs_2018) with a median error of 0.03 taps and quartiles of 0.05, threshold as logged.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mine_loc_sim import radio_constants as constants
from mine_loc_sim.dw1000_accumulator import Reception

_BEFORE, _AFTER = 10, 10


@dataclass(frozen=True, slots=True)
class ReceiveRegisters:
    """What the chip reports on `n` receptions (User Manual 4.7, 7.2.18-7.2.22); NaN or 0 where nothing was detected."""

    detected: NDArray[np.bool_]
    first_path_index: NDArray[np.float64]  # taps, multiples of 1/64
    threshold: NDArray[np.float64]  # counts, LDE_THRESH
    first_path_amplitude: NDArray[np.int64]  # (n, 3), F1..F3
    noise_std: NDArray[np.int64]
    cir_power: NDArray[np.int64]
    rxpacc: NDArray[np.int64]
    rxpacc_nosat: NDArray[np.int64]
    receive_power_dbm: NDArray[np.float64]
    first_path_power_dbm: NDArray[np.float64]


def noise_std(magnitude: NDArray[np.float32]) -> NDArray[np.float64]:
    """STD_NOISE of magnitudes (n, 1016), by the spread of |z| before the first path."""
    first, last = constants.NOISE_WINDOW_TAPS
    return constants.STD_NOISE_SHARE * np.asarray(magnitude[:, first:last].std(axis=1), float)


def threshold(deviation: NDArray[np.float64], symbols: NDArray[np.int64], full_count: int) -> NDArray[np.float64]:
    """LDE_THRESH: NTM times the noise, more when accumulation stopped early."""
    early = np.clip(constants.SATURATED_THRESHOLD_SHARE * full_count / symbols, 1.0, constants.SATURATED_THRESHOLD_MOST)
    return constants.NOISE_THRESHOLD_MULTIPLIER * deviation * early


def first_path_index(magnitude: NDArray[np.float32], level: NDArray[np.float64]) -> NDArray[np.float64]:
    """First-path index [taps] of magnitudes (n, 1016) for thresholds (n,); NaN where nothing passes."""
    start = constants.SEARCH_START_TAP
    above = magnitude[:, start : -_AFTER - 1] > level[:, None]
    found = above.any(axis=1)
    crossing = start + above.argmax(axis=1)
    rows = np.arange(len(magnitude))
    window = magnitude[rows[:, None], crossing[:, None] + np.arange(-_BEFORE, _AFTER + 1)]
    ahead = window[:, _BEFORE:]
    top = _BEFORE + (np.diff(ahead, axis=1) <= 0.0).argmax(axis=1)
    half = 0.5 * window[rows, top]
    below = (window < half[:, None]) & (np.arange(window.shape[1]) < top[:, None])
    last_below = window.shape[1] - 1 - below[:, ::-1].argmax(axis=1)
    foot = np.where(below.any(axis=1), last_below, top - 1)
    low, high = window[rows, foot], window[rows, foot + 1]
    # Where the search starts inside a response nothing before it is below half: the edge is then the sample itself.
    edge = foot + np.clip((half - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
    index = np.round((crossing - _BEFORE + edge) * 64.0) / 64.0
    return np.where(found, index, np.nan)


def detect(reception: Reception) -> NDArray[np.float64]:
    """First-path index [taps] of `n` receptions, NaN where nothing passes the threshold."""
    magnitude = np.abs(reception.samples)
    return first_path_index(magnitude, threshold(noise_std(magnitude), reception.symbols, reception.full_count))


def read_registers(reception: Reception) -> ReceiveRegisters:
    """Run the leading-edge detection and compute the registers of `n` receptions."""
    magnitude = np.abs(reception.samples)
    deviation = noise_std(magnitude)
    level = threshold(deviation, reception.symbols, reception.full_count)
    index = first_path_index(magnitude, level)
    detected = np.isfinite(index)
    floor = np.where(detected, np.floor(np.where(detected, index, 0.0)), 0).astype(int)
    amplitude = np.rint(magnitude[np.arange(len(floor))[:, None], floor[:, None] + np.arange(1, 4)]).astype(int)
    noise_energy = (magnitude[:, slice(*constants.NOISE_WINDOW_TAPS)] ** 2).mean(axis=1) * magnitude.shape[1]
    energy = np.maximum((magnitude.astype(float) ** 2).sum(axis=1) - noise_energy, 2.0**17)
    cir_power = np.minimum(np.rint(energy / 2.0**17), 65535).astype(int)
    symbols = reception.symbols
    rxpacc = np.where(reception.saturated, symbols, symbols + constants.SFD_SYMBOLS)
    nosat = np.full_like(symbols, reception.full_count + constants.SFD_SYMBOLS)
    first_energy = np.maximum((amplitude.astype(float) ** 2).sum(axis=1), 1.0)
    return ReceiveRegisters(
        detected,
        index,
        level,
        np.where(detected[:, None], amplitude, 0),
        np.rint(deviation).astype(int),
        cir_power,
        rxpacc,
        nosat,
        _power_dbm(cir_power * 2.0**17, symbols),
        np.where(detected, _power_dbm(first_energy, symbols), np.nan),
    )


def _power_dbm(energy: NDArray[np.float64], symbols: NDArray[np.int64]) -> NDArray[np.float64]:
    return np.asarray(10.0 * np.log10(energy / symbols.astype(float) ** 2) - constants.POWER_CONSTANT_DB)
