"""The 40-bit clock of a DW1000: 15.65 ps ticks, an own rate that wanders, a wrap every 17.2 s."""

import math

import numpy as np

from mine_loc_core.stamps import to_s
from mine_loc_sim import radio_constants as constants

_TICKS_PER_10_MS = 638_976_000
_NS_PER_10_MS = 10_000_000
_WRAP = 1 << 40


class DeviceTicks:
    """One radio's clock."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._rate_ppm = constants.CRYSTAL_OFFSET_SD_PPM * rng.standard_normal()
        self._start = int(rng.integers(_WRAP))
        self._extra_ticks = 0.0
        self._last_ns: int | None = None
        self._first_ns = 0

    @property
    def rate_ppm(self) -> float:
        """How much too fast the crystal runs now."""
        return self._rate_ppm

    def at(self, stamp_ns: int) -> int:
        """Counter at true time `stamp_ns`, 0 to 2^40 - 1. Raises ValueError if time runs backwards."""
        if self._last_ns is None:
            self._first_ns = self._last_ns = stamp_ns
        if stamp_ns < self._last_ns:
            raise ValueError(f"stamp_ns: {stamp_ns} is before the last one, {self._last_ns}; allowed: none earlier")
        gone_ns = stamp_ns - self._last_ns
        self._last_ns = stamp_ns
        self._extra_ticks += gone_ns * 1e-6 * self._rate_ppm * _TICKS_PER_10_MS / _NS_PER_10_MS
        wander = constants.CRYSTAL_WANDER_PPM_PER_ROOT_S * math.sqrt(to_s(gone_ns))
        self._rate_ppm += wander * self._rng.standard_normal()
        true_ticks = (stamp_ns - self._first_ns) * _TICKS_PER_10_MS // _NS_PER_10_MS
        return (self._start + true_ticks + round(self._extra_ticks)) % _WRAP
