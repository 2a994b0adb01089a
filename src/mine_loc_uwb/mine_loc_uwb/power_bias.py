"""Range bias of the DW1000 by received power: a table, interpolated.

The bias is reported minus true range, so the true range is the reported one minus the bias. Two laws besides none:
Decawave's APS011, table 2 (channel bandwidth 500 or 900 MHz, PRF 16 or 64 MHz), and a table measured
on the site's own radios. Firmware that has corrected its ranges already (DWM1001, TREK1000 `mc`) wants none.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from mine_loc_core.errors import ConfigurationError
from mine_loc_uwb.received_power import uncompress_dbm

Array = npt.NDArray[np.float64]
Kind = Literal["none", "aps011", "table"]

_APS011_LEVEL_DBM = tuple(float(level) for level in range(-95, -60, 2))
_APS011_MM: dict[tuple[int, int], tuple[int, ...]] = {
    (500, 16): (112, 110, 106, 97, 84, 65, 36, 0, -31, -59, -84, -109, -127, -143, -163, -179, -187, -198),
    (500, 64): (86, 81, 76, 71, 62, 49, 42, 35, 21, 0, -27, -51, -69, -82, -93, -100, -105, -110),
    (900, 16): (394, 356, 339, 321, 294, 254, 210, 158, 97, 42, 0, -51, -95, -138, -176, -210, -244, -275),
    (900, 64): (284, 264, 245, 233, 197, 175, 153, 127, 91, 49, 0, -58, -100, -150, -199, -235, -266, -295),
}
"""Reported minus true range by bandwidth [MHz] and PRF [MHz], at the levels above."""


@dataclass(frozen=True, slots=True)
class PowerBias:
    """A law; without entries there is no bias. Levels [dBm] rise; beyond the ends the last bias [m] holds."""

    kind: Kind = "none"
    level_dbm: tuple[float, ...] = ()
    bias_m: tuple[float, ...] = ()
    bandwidth_mhz: int = 0
    prf_mhz: int = 0
    """Not 0: the levels are true ones, and reported powers, compressed at this PRF, are expanded first."""

    def at_level_m(self, level_dbm: Array) -> Array:
        """Bias [m] by level on the table's own scale, any shape; 0 where the level is not finite, i.e. not known."""
        if not self.level_dbm:
            return np.zeros(np.shape(level_dbm))
        known = np.isfinite(level_dbm)
        return np.asarray(np.where(known, np.interp(level_dbm, self.level_dbm, self.bias_m), 0.0))

    def at_reported_power_m(self, receive_power_dbm: Array) -> Array:
        """Bias [m] by received power as a device reports it (DW1000 User Manual 4.7.2), any shape; 0 where unknown."""
        power_dbm = np.asarray(receive_power_dbm, np.float64)
        return self.at_level_m(uncompress_dbm(power_dbm, self.prf_mhz) if self.prf_mhz else power_dbm)


NO_POWER_BIAS = PowerBias()


def aps011(bandwidth_mhz: int, prf_mhz: int) -> PowerBias:
    """The law of APS011, table 2, over true levels. Raises ConfigurationError for what the table does not hold."""
    millimetres = _APS011_MM.get((bandwidth_mhz, prf_mhz))
    if millimetres is None:
        raise ConfigurationError(
            f"power_bias: bandwidth_mhz {bandwidth_mhz}, prf_mhz {prf_mhz}; allowed: 500 or 900 with 16 or 64"
        )
    bias_m = tuple(1e-3 * each for each in millimetres)
    return PowerBias("aps011", _APS011_LEVEL_DBM, bias_m, bandwidth_mhz, prf_mhz)


def measured_table(receive_power_dbm: Array, error_m: Array, *, knots: int = 12, least: int = 30) -> PowerBias:
    """A table from range errors (n,) of links in line of sight by reported power (n,).

    Median error of up to `knots` equal shares of the pairs, at least `least` each, less the median of all, which is
    the antenna delay's. Powers that are not finite are left out; no law results from fewer than two knots.
    """
    known = np.isfinite(receive_power_dbm) & np.isfinite(error_m)
    power_dbm, error_m = receive_power_dbm[known], error_m[known]
    shares = np.array_split(np.argsort(power_dbm, kind="stable"), max(min(knots, len(power_dbm) // least), 1))
    level_dbm = np.array([np.median(power_dbm[share]) for share in shares if len(share)])
    bias_m = np.array([np.median(error_m[share]) for share in shares if len(share)])
    level_dbm, first = np.unique(level_dbm, return_index=True)
    if len(level_dbm) < 2:
        return NO_POWER_BIAS
    bias_m = bias_m[first] - np.median(error_m)
    return PowerBias("table", tuple(level_dbm.tolist()), tuple(bias_m.tolist()))
