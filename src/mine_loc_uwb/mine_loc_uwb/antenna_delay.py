"""Antenna delay: the constant part of a range that the wave spends in cables, antennas and chips.

A DW1000 takes its transmit and receive antenna delays off each time stamp; set too small, they leave every range of the
device long. The sign here is that of `Anchor.range_offset_m`: reported minus true, subtracted from the range.
"""

import numpy as np
import numpy.typing as npt

from mine_loc_uwb.ranging import LIGHT_IN_AIR_M_PER_S

Array = npt.NDArray[np.float64]

TICK_S = 1.0 / (128 * 499.2e6)
"""Unit of the DW1000's time stamps and antenna delay registers, 15.65 ps (User Manual, 7.2.40)."""

TICK_M = TICK_S * LIGHT_IN_AIR_M_PER_S
"""One tick more in both registers of one device shortens its two-way ranges by this, 4.69 mm: each of its two stamps
in an exchange carries a delay, and half of the sum goes into the range."""


def offset_of_delay_m(true_ticks: float, set_ticks: float) -> float:
    """How much too long [m] a device with these antenna delays, the same for both directions, measures."""
    return (true_ticks - set_ticks) * TICK_M


def ticks_of_offset(offset_m: float) -> int:
    """By how many ticks to raise both registers of one device so that ranges lose `offset_m`."""
    return round(offset_m / TICK_M)


def fit_offset_m(error_m: Array) -> float:
    """The offset [m] of clear links from their range errors (n,), other biases taken off: the median; 0 of none."""
    finite = error_m[np.isfinite(error_m)]
    return float(np.median(finite)) if len(finite) else 0.0
