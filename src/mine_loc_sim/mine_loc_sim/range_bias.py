"""Bias of a reported range by received level (Decawave APS011 table 2) and the detector's own constant lead."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from mine_loc_sim import radio_constants as constants
from mine_loc_sim.channel_15_4a import FINE_PER_TAP
from mine_loc_sim.dw1000_accumulator import Receiver, accumulate, band_limit, taps_to_m
from mine_loc_sim.leading_edge import read_registers
from mine_loc_uwb.power_bias import aps011

_CHANNEL_2 = aps011(bandwidth_mhz=500, prf_mhz=64)
_PHASES = 512
_CALIBRATION_LEVEL_DBM = -80.0


def level_bias_m(level_dbm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Reported minus true range [m] by true received level, any shape; held beyond the table's ends."""
    return _CHANNEL_2.at_level_m(level_dbm)


@cache
def edge_lead_m() -> float:
    """How far before a lone path's centre its half-height edge is found: what antenna delay calibration removes."""
    taps = np.zeros((_PHASES, FINE_PER_TAP), np.complex64)
    taps[:, 0] = 1.0
    receiver = Receiver(np.full(_PHASES, constants.NOISE_PER_SYMBOL_COUNTS), np.zeros(_PHASES))
    level_dbm = np.full(_PHASES, _CALIBRATION_LEVEL_DBM)
    reception = accumulate(band_limit(taps), np.zeros(_PHASES), level_dbm, receiver, np.random.default_rng(0))
    found = read_registers(reception).first_path_index
    return float(np.median(taps_to_m(reception.direct_index - found)))
