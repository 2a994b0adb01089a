"""Receptions made up for tests: a pulse over noise, as a DW1000 would hold it."""

import numpy as np

from mine_loc_uwb.cir_frames import CirFrames
from mine_loc_uwb.labelled_frames import LabelledFrames, allowed_classes


def pulses(
    first_path, *, gain=1.0, taps=1016, noise=40.0, delays=(0.0,), levels=(1.0,), seed=0, **columns
) -> CirFrames:
    """Frames with band-limited paths at `first_path` plus `delays` taps; first_path: (n,)."""
    first_path = np.atleast_1d(np.asarray(first_path, float))
    rng = np.random.default_rng(seed)
    tap = np.arange(taps)
    samples = noise / np.sqrt(2.0) * rng.standard_normal((len(first_path), taps, 2))
    for delay, level in zip(delays, levels, strict=True):
        distance = tap - first_path[:, None] - 1.0 - delay
        pulse = np.where(np.abs(distance) < 2.2, np.cos(np.pi * distance / 4.4) ** 2, 0.0)
        samples[..., 0] += 12_000 * level * pulse
        samples[..., 1] += 5_000 * level * pulse
    samples *= gain
    count = len(first_path)
    known = {
        "samples": np.rint(samples).astype(np.int16),
        "start_index": np.zeros(count, int),
        "first_path_index": first_path,
        "symbols": np.full(count, 400.0),
        "noise_std": np.full(count, np.nan),
        "receive_power_dbm": np.full(count, -80.0),
        "first_path_power_dbm": np.full(count, -85.0),
        "range_m": np.full(count, 4.0),
        "channel": np.full(count, 2),
    }
    return CirFrames(**known | columns)


def labelled(placements: int = 8, frames: int = 12, seed: int = 0) -> LabelledFrames:
    """Placements of which every other is LOS: strong and compact; the others are weak, with a later peak."""
    rng = np.random.default_rng(seed)
    parts, labels, numbers = [], [], []
    for place in range(placements):
        los = place % 2 == 0
        level = rng.uniform(-81, -79) if los else rng.uniform(-90, -84)
        shape = ((0.0, 6.0), (1.0, 0.3)) if los else ((0.0, 6.0, 14.0), (0.3, 0.6, 0.5))
        parts.append(
            pulses(
                745.0 + rng.random(frames), delays=shape[0], levels=shape[1], seed=seed + place,
                receive_power_dbm=level + 0.2 * rng.standard_normal(frames),
                first_path_power_dbm=level - (3.0 if los else 9.0) + 0.2 * rng.standard_normal(frames),
            )
        )  # fmt: skip
        labels += ["LOS" if los else "NLOS"] * frames
        numbers += [place] * frames
    names = CirFrames.__dataclass_fields__
    joined = CirFrames(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
    stamps = np.arange(len(labels)) * 50_000_000
    return LabelledFrames(joined, allowed_classes(labels), np.array(numbers), numbers, stamps)
