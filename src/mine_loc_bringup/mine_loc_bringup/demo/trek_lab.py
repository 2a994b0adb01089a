"""The laboratory run `m1l` of trek1000_bielefeld (Sang et al., WPNC 2019), re-encoded as the kit's `mc` lines."""

from dataclasses import dataclass
from math import nan

import numpy as np
import numpy.typing as npt
import scipy.io

from mine_loc_bringup.demo.recording import Array, Recording, Truth, data_file
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_sim.timed_bytes import Arrival
from mine_loc_uwb.ranging import Range, RangingRound
from mine_loc_uwb.wire.trek1000 import encode_round

Integers = npt.NDArray[np.int64]

_REPORTER = 1  # anchor A0 is the one on the serial line


@dataclass(frozen=True, slots=True)
class LabRun:
    """Ranges (n, 4) [m], NaN = not measured, at `ms` (n,) of the kit's clock, and Vicon positions (m, 3) on its own."""

    ms: Integers
    ranges_m: Array
    truth: Truth


def read(run: str) -> LabRun:
    """One of the runs that have truth: m1l, m2r."""
    rows = np.loadtxt(data_file("trek1000_bielefeld", "exp_data", "UWB_data_Ranges", f"output_range_uwb_{run}.txt"))
    ms_of_day = _ms_of_day(rows[:, 0].astype(np.int64))
    vicon_file = data_file("trek1000_bielefeld", "exp_data", "Vicon_mat", f"{run[:2]}{run[2:].upper()}.mat")
    vicon = scipy.io.loadmat(vicon_file)["posedata_uwb"]
    times_s = (vicon[:, 1] - vicon[0, 1]) + vicon[:, 2] * 1e-9
    ranges_m = np.where(rows[:, 2:6] > 0.0, rows[:, 2:6] / 1e3, nan)
    return LabRun(ms_of_day - ms_of_day[0], ranges_m, Truth("walker", times_s, vicon[:, 3:6]))


def load() -> Recording:
    """Ranges of a carried tag to four anchors at 10 Hz, Vicon truth on a clock and in a frame of its own."""
    run = read("m1l")
    arrivals: list[Arrival] = [
        (int(ms) * NS_PER_MS, encode_round(_round(i, int(ms), row)))
        for i, (ms, row) in enumerate(zip(run.ms, run.ranges_m, strict=True))
    ]
    lasts_s = arrivals[-1][0] / NS_PER_S
    return Recording("trek1000_bielefeld m1l", "trek_lab", {"trek": arrivals}, lasts_s, [run.truth])


def _ms_of_day(hhmmssmmm: Integers) -> Integers:
    hours, minutes, ms = hhmmssmmm // 10_000_000, hhmmssmmm // 100_000 % 100, hhmmssmmm % 100_000
    return np.asarray((hours * 60 + minutes) * 60_000 + ms, dtype=np.int64)


def _round(number: int, ms: int, ranges_m: Array) -> RangingRound:
    ranges = [Range(i + 1, float(range_m)) for i, range_m in enumerate(ranges_m)]
    return RangingRound(1, _REPORTER, number % 256, ms, tuple(ranges), corrected=True)
