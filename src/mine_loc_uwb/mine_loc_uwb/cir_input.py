"""What the LOS classifier sees of a reception: one implementation for training and for live use.

The accumulator is cut round the first path, shifted by the fraction of a tap so that the leading edge always lies at
the same place, and given as two profiles: magnitude over its peak, and decibels above the noise. Beside them stand
side features: powers, noise, delays, and what the measured range says the powers should be in free space.
"""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
import scipy.fft
from numba import njit
from numpy.typing import NDArray

from mine_loc_uwb import delay_features
from mine_loc_uwb.cir_frames import CirFrames
from mine_loc_uwb.received_power import free_space_level_dbm, reported_level_dbm

Floats = NDArray[np.float32]
BEFORE, TAPS = 16, 128
"""Window round floor(first path): 16 taps before to 111 after hold essentially all energy (hardware.md B.6)."""
EDGE_PER_TAP, EDGE_TAPS = 4, 8
"""The leading edge, 2 taps before to 6 after the first path, is given in quarters of a tap."""
CHANNELS = 2

SIDE_NAMES = (
    "receive_power_dbm",
    "first_path_gap_db",
    "log_noise_per_symbol",
    "log_symbols",
    "receive_power_against_free_space_db",
    "first_path_power_against_free_space_db",
    "log_range",
    *delay_features.NAMES,
)
RANGE_FEATURES = (4, 5, 6)
LEVEL_FEATURES = (0, 2, 3, *RANGE_FEATURES)
"""Numbers of the side features that need the range, and of those that tell levels."""
_QUIET_TAPS = 24  # taps up to so far ahead of the first path hold noise alone
_LEAST_QUIET = 64
_STD_NOISE_SHARE = 0.87  # STD_NOISE over the deviation of |z| (uwb_cirs_2018, as mine_loc_sim)
_RMS_OF_DEVIATION = 1.0 / np.sqrt(1.0 - np.pi / 4.0)  # of a Rayleigh magnitude
_RAIL = 32767
_TURN_A_TAP = (2j * np.pi * scipy.fft.fftfreq(TAPS)).astype(np.complex64)
_EDGE_AT = BEFORE - 2 + np.arange(EDGE_TAPS * EDGE_PER_TAP) / EDGE_PER_TAP
_TO_EDGE = (np.exp(2j * np.pi * scipy.fft.fftfreq(TAPS)[:, None] * _EDGE_AT) / TAPS).astype(np.complex64)
"""Band-limited interpolation of the leading edge from a window's spectrum."""


class Refusal(IntEnum):
    """Why a frame is not judged; the numbers of mine_loc_interfaces/LinkState."""

    NOT = 0
    NO_FIRST_PATH = 1
    SATURATED = 2
    TRUNCATED = 3
    EMPTY = 4


_NOT, _NO_FIRST_PATH, _SATURATED, _TRUNCATED, _EMPTY = map(int, Refusal)


@dataclass(frozen=True, slots=True, eq=False)
class LosInput:
    """Input of `n` accepted frames."""

    profile: Floats  # (n, CHANNELS, TAPS)
    edge: Floats  # (n, EDGE_TAPS * EDGE_PER_TAP), magnitude over its peak
    side: Floats  # (n, f) or with history (n, 2 f), f = len(SIDE_NAMES); NaN = not known

    def __len__(self) -> int:
        return len(self.profile)

    def take(self, which: NDArray[Any] | slice) -> "LosInput":
        """Only some of the frames."""
        return LosInput(self.profile[which], self.edge[which], self.side[which])

    def without_range(self) -> "LosInput":
        """The same input where no range is known."""
        side = self.side.copy()
        for first in range(0, side.shape[1], len(SIDE_NAMES)):
            side[:, [first + number for number in RANGE_FEATURES]] = np.nan
        return LosInput(self.profile, self.edge, side)


def refusals(frames: CirFrames) -> NDArray[np.int64]:
    """Judge whether each frame can be read: `Refusal` (n,)."""
    return _refusals(frames.samples, frames.first_path_index, frames.start_index)


@njit(cache=True)
def _refusals(samples: NDArray[np.int16], first_path: NDArray[Any], start: NDArray[np.int64]) -> NDArray[np.int64]:
    found = np.empty(len(samples), np.int64)
    for number in range(len(samples)):
        found[number] = _refusal(samples[number], first_path[number], start[number])
    return found


@njit(cache=True)
def _refusal(samples: NDArray[np.int16], first_path: float, start: int) -> int:
    """Of samples (taps, 2) whose first is tap `start` of the accumulator."""
    taps = len(samples)
    if taps == 0:
        return _EMPTY
    if not (first_path > 0.0 and 0.0 <= first_path - start < taps):
        return _NO_FIRST_PATH
    first = math.floor(first_path) - BEFORE - start
    inside = first >= 0 and first + TAPS <= taps
    held = samples[first : first + TAPS] if inside else samples
    least, most = held.min(), held.max()
    if least == 0 and most == 0:
        return _EMPTY
    if not inside:
        return _TRUNCATED
    return _SATURATED if most == _RAIL or least <= -_RAIL else _NOT


def los_input(frames: CirFrames) -> LosInput:
    """Compute the input of frames that `refusals` accepts; others raise IndexError or give nonsense."""
    whole = np.floor(frames.first_path_index).astype(int)
    fraction = (frames.first_path_index - whole).astype(np.float32)
    first = whole - BEFORE - frames.start_index
    raw = _window(frames.samples, first).astype(np.float32)
    spectrum = scipy.fft.fft(raw.view(np.complex64)[..., 0], axis=1)
    spectrum *= np.exp(_TURN_A_TAP * fraction[:, None])
    magnitude = np.abs(scipy.fft.ifft(spectrum, axis=1))
    noise = _noise_counts(frames, first, raw)
    peak = magnitude.max(axis=1, keepdims=True)
    above_noise = np.log10(np.maximum(magnitude / noise[:, None], 1.0))
    profile = np.stack([magnitude / peak, 0.5 * above_noise], axis=1).astype(np.float32)
    edge = np.abs(spectrum @ _TO_EDGE) / peak
    side = _side(frames, np.hypot(raw[..., 0], raw[..., 1]), fraction, noise)
    return LosInput(profile, edge.astype(np.float32), side)


def _window(samples: NDArray[np.int16], first: NDArray[np.int64]) -> NDArray[np.int16]:
    """The taps from `first` (n,) on of samples (n, taps, 2): (n, TAPS, 2), or fewer if there are not so many."""
    taps = np.arange(min(TAPS, samples.shape[1]))
    return np.asarray(samples[np.arange(len(samples))[:, None], first[:, None] + taps])


def _noise_counts(frames: CirFrames, first: NDArray[np.int64], raw: Floats) -> NDArray[np.float64]:
    """Deviation of |z| in noise (n,): from many taps ahead of the first path, or the register, or the few there are."""
    quiet = int(first.min()) + BEFORE - _QUIET_TAPS
    if quiet >= _LEAST_QUIET:
        return _deviation(frames.samples[:, :quiet])
    few = np.hypot(raw[:, : BEFORE - 4, 0], raw[:, : BEFORE - 4, 1]).std(axis=1)
    register = frames.noise_std / _STD_NOISE_SHARE
    return np.asarray(np.maximum(np.where(register > 0.0, register, few), 1.0))


@njit(cache=True)
def _deviation(samples: NDArray[np.int16]) -> NDArray[np.float64]:
    """Of |z| of samples (n, taps, 2) in counts, 1 at least."""
    found = np.empty(len(samples))
    for number in range(len(samples)):
        total = squares = 0.0
        for i, q in samples[number]:
            energy = float(i) * float(i) + float(q) * float(q)
            total += math.sqrt(energy)
            squares += energy
        mean = total / samples.shape[1]
        found[number] = math.sqrt(max(squares / samples.shape[1] - mean * mean, 1.0))
    return found


def _side(frames: CirFrames, window: Floats, fraction: Floats, noise: NDArray[np.float64]) -> Floats:
    expected_dbm = reported_level_dbm(free_space_level_dbm(frames.range_m, frames.channel))
    log_symbols = np.log(np.where(frames.symbols > 0, frames.symbols, np.nan))
    delays = delay_features.delay_features(window, BEFORE, -BEFORE - fraction, noise * _RMS_OF_DEVIATION)
    side = np.column_stack(
        [
            frames.receive_power_dbm,
            frames.receive_power_dbm - frames.first_path_power_dbm,
            np.log(noise) - log_symbols,
            log_symbols,
            frames.receive_power_dbm - expected_dbm,
            frames.first_path_power_dbm - expected_dbm,
            np.log(np.maximum(frames.range_m, 0.1)),
            delays,
        ]
    )
    return np.where(np.isfinite(side), side, np.nan).astype(np.float32)
