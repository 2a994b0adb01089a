"""uwb_cirs_2018 (Kolakowski and Modelski, MIKON 2018): accumulators of two EVK1000 in a flat, at labelled placements.

The folder has `cir_iq.npz` and `frames.csv` as `mine-loc train-los` takes them, with the ids and places of both ends,
the code of the frame that was received (21 poll, 29 final) and the receiver's time, which wraps.
"""

import functools
from pathlib import Path

import numpy as np

from mine_loc_bringup.los.recordings import read_folder, read_rows
from mine_loc_bringup.recordings.public_data import refused, required
from mine_loc_bringup.recordings.recording import (
    START_NS,
    Array,
    Instant,
    Integers,
    LabelledLink,
    Recording,
    TrueTrack,
    site_content,
    upright,
)
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_uwb.labelled_frames import LabelledFrames
from mine_loc_uwb.ranging import CirWindow, Range, RangingRound

_WRAP_S = 2**40 / (128 * 499.2e6)
"""Of the DW1000's 40-bit counter (User Manual, section 4.1.7)."""
_FINAL = "29"
_TRUTH_PERIOD_NS = 100 * NS_PER_MS
_PRF_MHZ = 64
_EXPECTED = "a folder with frames.csv and cir_iq.npz"
_COLUMNS = ("config", "anchor", "tag", "anchor_x", "anchor_y", "tag_x", "tag_y", "frame_code", "rx_time_s", "dist_m")


def names(folder: Path) -> list[str]:
    """Of all placements: `placement1` … by the number of the log. Raises ConfigurationError if there are none."""
    configs = {row["config"] for row in _everything(folder)[0]}
    return [f"placement{config}" for config in sorted(configs, key=int)]


def load(folder: Path, name: str) -> Recording:
    """One placement: an accumulator each frame, a range each final frame, and where both ends stood."""
    rows, everything = _everything(folder)
    which = np.flatnonzero([f"placement{row['config']}" == name for row in rows])
    placed, frames = [rows[index] for index in which.tolist()], everything.take(which)
    try:
        stamps_ns = START_NS + np.round(unwrapped_s([float(row["rx_time_s"]) for row in placed]) * NS_PER_S).astype(int)
        anchor_id, tag_id = int(placed[0]["anchor"]), int(placed[0]["tag"])
        anchor_m, tag_m = ((float(placed[0][f"{end}_x"]), float(placed[0][f"{end}_y"])) for end in ("anchor", "tag"))
    except ValueError as error:
        raise refused(folder / "frames.csv", error, "numbers") from None
    instants = [Instant(stamp_ns, stamp_ns) for stamp_ns in stamps_ns.tolist()]
    numbers = _exchange_numbers([row["frame_code"] for row in placed])
    person = f"tag{tag_id}"
    return Recording(
        name,
        site_content("uwb_cirs_flat", {anchor_id: (*anchor_m, 0.0)}, tag_height_m=0.0),
        [{"name": person, "tag_id": tag_id, "height_m": 1.75}],
        rounds=[
            (at, _round(frames, index, number, (tag_id, anchor_id)))
            for index, (at, number, row) in enumerate(zip(instants, numbers, placed, strict=True))
            if row["frame_code"] == _FINAL and np.isfinite(frames.frames.range_m[index])
        ],
        accumulators=[
            (at, _window(frames, index, number, (tag_id, anchor_id)))
            for index, (at, number) in enumerate(zip(instants, numbers, strict=True))
        ],
        tracks=[_at_rest(person, tag_m, stamps_ns)],
        links=[
            LabelledLink(stamp_ns, tag_id, anchor_id, tuple(allowed))
            for stamp_ns, allowed in zip(stamps_ns.tolist(), frames.allowed.tolist(), strict=True)
        ],
    )


def unwrapped_s(times_s: list[float]) -> Array:
    """Times (n,) of a counter that wraps, since the first; pauses are shorter than its period."""
    steps_s = np.diff(times_s, prepend=times_s[:1]) % _WRAP_S
    return np.asarray(np.cumsum(steps_s))


@functools.lru_cache(maxsize=1)
def _everything(folder: Path) -> tuple[list[dict[str, str]], LabelledFrames]:
    rows, columns = read_rows(required(folder / "frames.csv", _EXPECTED))
    if missing := [name for name in _COLUMNS if name not in columns]:
        raise ConfigurationError(f"{folder / 'frames.csv'}: no column {missing[0]}; allowed: {', '.join(_COLUMNS)}")
    return rows, read_folder(folder)


def _exchange_numbers(codes: list[str]) -> list[int]:
    """Number of the exchange of each frame: a poll begins one, and so does what follows a final."""
    begins = [code != _FINAL or before == _FINAL for before, code in zip(["", *codes], codes, strict=False)]
    return [int(number) for number in np.cumsum(begins) - 1]


def _round(frames: LabelledFrames, index: int, number: int, ids: tuple[int, int]) -> RangingRound:
    tag_id, anchor_id = ids
    cir = frames.frames
    measured = Range(
        anchor_id,
        float(cir.range_m[index]),
        first_path_power_dbm=float(cir.first_path_power_dbm[index]),
        receive_power_dbm=float(cir.receive_power_dbm[index]),
        first_path_index=float(cir.first_path_index[index]),
    )
    return RangingRound(tag_id, anchor_id, number, None, (measured,), corrected=False)


def _window(frames: LabelledFrames, index: int, number: int, ids: tuple[int, int]) -> CirWindow:
    tag_id, anchor_id = ids
    cir = frames.frames
    return CirWindow(
        tag_id=tag_id,
        anchor_id=anchor_id,
        seq=number,
        device_ticks=0,
        range_m=float(cir.range_m[index]),
        first_path_index=float(cir.first_path_index[index]),
        start_index=int(cir.start_index[index]),
        preamble_count=int(cir.symbols[index]),
        noise_std=float(cir.noise_std[index]),
        first_path_amplitude=(0, 0, 0),
        receive_power_counts=0,
        channel=int(cir.channel[index]),
        prf_mhz=_PRF_MHZ,
        in_phase=np.ascontiguousarray(cir.samples[index, :, 0]),
        quadrature=np.ascontiguousarray(cir.samples[index, :, 1]),
        first_path_power_dbm=float(cir.first_path_power_dbm[index]),
        receive_power_dbm=float(cir.receive_power_dbm[index]),
    )


def _at_rest(person: str, place_m: tuple[float, float], stamps_ns: Integers) -> TrueTrack:
    stamp_ns = np.arange(stamps_ns[0], stamps_ns[-1] + _TRUTH_PERIOD_NS, _TRUTH_PERIOD_NS)
    position_m = np.tile([*place_m, 0.0], (len(stamp_ns), 1))
    return TrueTrack(person, "map", stamp_ns, position_m, upright(len(stamp_ns)))
