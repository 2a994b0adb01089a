"""Received power of a DW1000 reception from its diagnostic registers (DW1000 User Manual, section 4.7)."""

from dataclasses import dataclass
from enum import IntEnum
from math import isnan, log10, nan, sqrt

import numpy as np
import numpy.typing as npt

from mine_loc_uwb.ranging import LIGHT_IN_AIR_M_PER_S

_A_DB = {16: 113.77, 64: 121.74}
"""The constant A of section 4.7.1 by PRF. Version 2.05 prints 115.72 for PRF 16 in 4.7.2; later versions correct it."""

_COMPRESSION_START_DBM = -88.0
_COMPRESSION_SLOPE = {16: 2.3334, 64: 1.1667}
_REPORTED_CEILING_DBM = -78.3
"""Strongest level ever reported: median of the strongest placements of uwb_cirs_2018 is -78.5, best frame -78.2."""

_TRANSMIT_POWER_DBM = -14.3
"""-41.3 dBm/MHz over 499.2 MHz: the legal limit, which DW1000 boards are set to; no antenna gain."""
_CARRIER_MHZ = {1: 3494.4, 2: 3993.6, 3: 4492.8, 4: 3993.6, 5: 6489.6, 7: 6489.6}
"""Centre frequencies of the DW1000's channels (User Manual, section 10.5)."""
_USUAL_CHANNEL = 2


class Sfd(IntEnum):
    """Start-of-frame delimiter in use; the numbers go over the wire."""

    UNKNOWN = 0
    STANDARD_8 = 1
    STANDARD_64 = 2
    DECAWAVE_8 = 3
    DECAWAVE_16 = 4
    DECAWAVE_64 = 5


_SFD_SYMBOLS_COUNTED: dict[int, int] = {
    Sfd.UNKNOWN: 0,
    Sfd.STANDARD_8: 5,
    Sfd.STANDARD_64: 64,
    Sfd.DECAWAVE_8: 10,
    Sfd.DECAWAVE_16: 18,
    Sfd.DECAWAVE_64: 82,
}


@dataclass(frozen=True, slots=True)
class Reception:
    """The diagnostic registers of one reception; 0 everywhere = not reported."""

    first_path_index_64: int = 0
    """FP_INDEX, unsigned 10.6 fixed point [1/64 tap]."""
    first_path_amplitude: tuple[int, int, int] = (0, 0, 0)
    noise_std: int = 0
    receive_power_counts: int = 0
    """CIR_PWR."""
    preamble_count: int = 0
    """RXPACC."""
    preamble_count_unsaturated: int = 0
    """RXPACC_NOSAT; equal to RXPACC when that still counts symbols of the SFD."""
    channel: int = 0
    prf_mhz: int = 0
    sfd: int = Sfd.UNKNOWN

    @property
    def first_path_index(self) -> float:
        """First path in the accumulator [taps], NaN = none."""
        return self.first_path_index_64 / 64 if self.first_path_index_64 else nan


def accumulated_symbols(reception: Reception) -> int:
    """RXPACC without the symbols of the SFD it also counted (section 7.2.18, RXPACC_NOSAT); 0 = not reported."""
    count = reception.preamble_count
    if count == reception.preamble_count_unsaturated:
        count -= _SFD_SYMBOLS_COUNTED.get(reception.sfd, 0)
    return max(count, 0)


def first_path_power_dbm(amplitudes: tuple[int, int, int], symbols: int, prf_mhz: int) -> float:
    """Power of the first path [dBm] from F1..F3 and the accumulated preamble symbols (section 4.7.1).

    NaN when a register or the PRF (16 or 64 MHz) is not reported.
    """
    f1, f2, f3 = amplitudes
    return _power_dbm(f1 * f1 + f2 * f2 + f3 * f3, symbols, prf_mhz)


def receive_power_dbm(counts: int, symbols: int, prf_mhz: int) -> float:
    """Power of the whole reception [dBm] from CIR_PWR and the accumulated preamble symbols (section 4.7.2).

    NaN when a register or the PRF (16 or 64 MHz) is not reported.
    """
    return _power_dbm(counts << 17, symbols, prf_mhz)


def _power_dbm(energy: int, symbols: int, prf_mhz: int) -> float:
    if energy <= 0 or symbols <= 0 or prf_mhz not in _A_DB:
        return nan
    return 10 * log10(energy / (symbols * symbols)) - _A_DB[prf_mhz]


def powers_dbm(reception: Reception) -> tuple[float, float]:
    """(first path, whole reception) [dBm] of one reception, NaN where not reported."""
    symbols = accumulated_symbols(reception)
    return (
        first_path_power_dbm(reception.first_path_amplitude, symbols, reception.prf_mhz),
        receive_power_dbm(reception.receive_power_counts, symbols, reception.prf_mhz),
    )


def uncompress_dbm(power_dbm: npt.NDArray[np.float64], prf_mhz: int) -> npt.NDArray[np.float64]:
    """Undo the saturation of the power estimate above -88 dBm, as thotro/arduino-dw1000 does; any shape, NaN stays."""
    excess_db = np.maximum(power_dbm - _COMPRESSION_START_DBM, 0.0)
    return power_dbm + excess_db * _COMPRESSION_SLOPE[prf_mhz]


def reported_level_dbm(level_dbm: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """What the power registers make of true received levels at PRF 64 MHz; the inverse of `uncompress_dbm`, capped."""
    excess_db = np.maximum(level_dbm - _COMPRESSION_START_DBM, 0.0)
    compressed = np.minimum(level_dbm, _COMPRESSION_START_DBM) + excess_db / (1.0 + _COMPRESSION_SLOPE[64])
    return np.asarray(np.minimum(compressed, _REPORTED_CEILING_DBM))


def free_space_level_dbm(range_m: npt.NDArray[np.float64], channel: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
    """True level [dBm] at ranges (n,) in free space (Friis), isotropic antennas; NaN ranges give NaN.

    channel: (n,) UWB channels; one that is not known is taken for 2. Ranges below 0.1 m count as 0.1 m.
    """
    mhz = np.array([_CARRIER_MHZ.get(number, _CARRIER_MHZ[_USUAL_CHANNEL]) for number in channel.tolist()])
    wavelength_m = LIGHT_IN_AIR_M_PER_S / (mhz * 1e6)
    turns = 4.0 * np.pi * np.maximum(range_m, 0.1) / wavelength_m
    return np.asarray(_TRANSMIT_POWER_DBM - 20.0 * np.log10(turns))


def los_probability_from_powers(first_path_dbm: float, receive_dbm: float) -> float:
    """Line-of-sight probability by the rule of section 4.7: 1 up to a gap of 6 dB, 0 from 10 dB, linear between.

    NaN when a power is not reported. On public data the 6 dB limit flags 15-27 % of true LOS: fit to widen a variance,
    not to reject a range.
    """
    gap_db = receive_dbm - first_path_dbm
    return gap_db if isnan(gap_db) else min(max((10.0 - gap_db) / 4.0, 0.0), 1.0)


def odds_of_power_rule(rule: float) -> float:
    """What the answer of `los_probability_from_powers` is worth as a probability at even odds; NaN stays NaN.

    On three public data sets the gap is below 6 dB on some 80 % of LOS links and 33 % of the others, above 10 dB on 3 %
    and 40 % (hardware notes D.2): 0.71, 0.39 and 0.07, a straight line in the rule's 1, 0.5 and 0.
    """
    return 0.07 + 0.64 * rule


def reception_with_powers(first_path_dbm: float, receive_dbm: float, symbols: int, prf_mhz: int) -> Reception:
    """Registers that a device would report at these powers, for simulators: F1 = F2 = F3, to the rounding of registers.

    Saturates at 16 bits as the registers do; NaN powers give 0 = not reported.
    """
    amplitude = symbols * sqrt(_linear(first_path_dbm + _A_DB[prf_mhz]) / 3)
    counts = symbols * symbols * _linear(receive_dbm + _A_DB[prf_mhz]) / 2**17
    f = min(round(amplitude), 0xFFFF)
    return Reception(
        first_path_amplitude=(f, f, f),
        receive_power_counts=min(round(counts), 0xFFFF),
        preamble_count=symbols,
        prf_mhz=prf_mhz,
    )


def _linear(power_db: float) -> float:
    return 0.0 if isnan(power_db) else 10 ** (power_db / 10)
