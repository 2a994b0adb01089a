"""The laboratory run `m1l` of trek1000_bielefeld (Sang et al., WPNC 2019), re-encoded as the kit's `mc` lines."""

from dataclasses import dataclass

from mine_loc_bringup.demo.playback import Array, Playback, Truth
from mine_loc_bringup.recordings import trek1000
from mine_loc_bringup.recordings.public_data import data_file
from mine_loc_bringup.recordings.recording import Integers
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_sim.timed_bytes import Arrival
from mine_loc_uwb.wire.trek1000 import encode_round


@dataclass(frozen=True, slots=True)
class LabRun:
    """Ranges (n, 4) [m], NaN = not measured, at `ms` (n,) since the first, and Vicon's track since its own."""

    ms: Integers
    ranges_m: Array
    truth: Truth


def read(run: str) -> LabRun:
    """One of the runs that have truth: m1l, m2r."""
    folder = data_file("trek1000_bielefeld")
    log = trek1000.read_log(folder / "exp_data" / "UWB_data_Ranges" / f"output_range_uwb_{run}.txt")
    vicon = trek1000.read_vicon(trek1000.vicon_file(folder, run) or folder / f"{run}.mat")
    times_s = (vicon.stamp_ns - vicon.stamp_ns[0]) / NS_PER_S
    return LabRun(log.ms_of_day - log.ms_of_day[0], log.ranges_m, Truth(trek1000.PERSON, times_s, vicon.position_m))


def load() -> Playback:
    """Ranges of a carried tag to four anchors at 10 Hz, Vicon truth on a clock and in a frame of its own."""
    run = read("m1l")
    arrivals: list[Arrival] = [
        (int(ms) * NS_PER_MS, encode_round(trek1000.round_of(i, int(ms), 0, row)))
        for i, (ms, row) in enumerate(zip(run.ms, run.ranges_m, strict=True))
    ]
    lasts_s = arrivals[-1][0] / NS_PER_S
    return Playback("trek1000_bielefeld m1l", "trek_lab", {"trek": arrivals}, lasts_s, [run.truth])
