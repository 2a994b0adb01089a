"""Fit the measured constants of `mine_loc_sim.gait_constants` to the odd subjects of ipol_gait_lowerback.

    python bench/calibrate_gait.py

The even subjects are never read here: `bench/sim_gait.py` scores on them.
"""

import os
import sys
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from gait_measures import PHASE_POINTS, strides
from gait_recordings import Array, steady_speed, walks
from scipy.spatial.transform import Rotation

HARMONICS = 16
CHANNELS = ("forward", "left", "up", "roll", "pitch", "yaw")
MIRRORING = ("left", "roll", "yaw")  # change sign from a left to a right step: odd harmonics of the stride


@dataclass(frozen=True, slots=True)
class Subject:
    """One trial's figures."""

    height_m: float | None
    speed_m_s: float
    step_hz: float
    harmonics: np.ndarray
    residual_rms: Array  # (6,), strides about their mean
    residual_hz: Array  # (6,), median frequency of its power
    gain_sd: Array  # (6,), of each stride's projection on the mean stride
    mean_sd: Array  # (6,), of the strides' means


def kinematic_harmonics(wave: Array, stride_s: float) -> np.ndarray:
    """Harmonics 1..HARMONICS of a mean stride: acceleration in the heading frame (3), rates of the pelvis (3)."""
    omega = 2 * np.pi / stride_s
    k = np.arange(1, HARMONICS + 1)
    spectrum = 2 * np.fft.rfft(wave, axis=0)[1 : HARMONICS + 1] / PHASE_POINTS
    angles = spectrum[:, 3:] / (1j * k[:, None] * omega)
    grid = np.exp(1j * np.outer(2 * np.pi * np.arange(PHASE_POINTS) / PHASE_POINTS, k))
    attitude = Rotation.from_euler("xyz", (grid @ angles).real)
    level = attitude.apply(wave[:, :3])
    acceleration = 2 * np.fft.rfft(level, axis=0)[1 : HARMONICS + 1] / PHASE_POINTS
    return np.hstack([acceleration, spectrum[:, 3:]])


def residual(waves: Array, stride_s: float) -> tuple[Array, Array, Array, Array]:
    """Of strides (n, PHASE_POINTS, 6) about their mean: rms, median frequency of power, scatter of gain and of mean."""
    about = waves - waves.mean(axis=0)
    power = (np.abs(np.fft.rfft(about, axis=1)) ** 2).mean(axis=0)
    share = np.cumsum(power, axis=0) / power.sum(axis=0)
    half = np.array([np.interp(0.5, share[:, c], np.arange(len(share))) for c in range(share.shape[1])])
    shape = waves.mean(axis=0) - waves.mean(axis=(0, 1))
    gain_sd = ((waves * shape).sum(axis=1) / (shape**2).sum(axis=0)).std(axis=0)
    return np.sqrt((about**2).mean(axis=(0, 1))), half / stride_s, gain_sd, waves.mean(axis=1).std(axis=0)


def subject_harmonics(rows: list[Subject]) -> np.ndarray:
    """Median over a subject's trials, robust to a trial with wrongly marked strikes."""
    series = np.array([row.harmonics for row in rows])
    return np.median(series.real, axis=0) + 1j * np.median(series.imag, axis=0)


def channel_lines(name: str, series: np.ndarray, log_sd: Array) -> list[str]:
    """Constants of one channel, as they stand in gait_constants; `series` is (subjects, HARMONICS)."""
    mirrors = name in MIRRORING
    regular = np.arange(1, HARMONICS + 1) % 2 == int(mirrors)
    amplitude = np.median(np.abs(series), axis=0)
    resultant = (series / np.abs(series)).mean(axis=0)
    spread = np.sqrt(-2 * np.log(np.abs(resultant)))

    def row(values: Array, digits: int) -> str:
        return "(" + ", ".join(f"{v:.{digits}f}" for v in values) + ")"

    return [
        f'    Channel("{name}", {mirrors}, {row(amplitude[regular], 3)},',
        f"            {row(log_sd[regular], 2)},",
        f"            {row(np.angle(resultant[regular]), 2)},",
        f"            {row(spread[regular], 2)},",
        f"            {row(amplitude[~regular], 3)}),",
    ]


def main() -> None:
    """Print the table of harmonics and the scalars of the calibration half."""
    folder = Path(os.environ["MINE_LOC_DATA"]) / "ipol_gait_lowerback" / "GaitData"
    people: dict[int, list[Subject]] = defaultdict(list)
    for walk in walks(folder, odd_subjects=True):
        waves, durations = strides(walk)
        if len(durations) >= 4:
            speed = steady_speed(walk)
            mean = kinematic_harmonics(waves.mean(axis=0), float(durations.mean()))
            rest = residual(waves, float(durations.mean()))
            people[walk.subject].append(Subject(walk.height_m, speed, 2 / float(durations.mean()), mean, *rest))
    series = np.array([subject_harmonics(rows) for rows in people.values()])
    energy = np.sqrt((np.abs(series) ** 2).sum(axis=1) / 2)
    log_sd = (np.log(np.abs(series)) - np.log(energy)[:, None, :]).std(axis=0, ddof=1)
    for c, name in enumerate(CHANNELS):
        print("\n".join(channel_lines(name, series[:, :, c], log_sd[:, c])))
    speed = np.array([np.median([r.speed_m_s for r in rows]) for rows in people.values()])
    cadence = np.array([np.median([r.step_hz for r in rows]) for rows in people.values()])
    height = np.array([rows[0].height_m for rows in people.values()], dtype=float)
    law = 0.7 + 0.371 * (height - 1.75) + 0.227 * (cadence - 1.79) * height / 1.75
    factor = speed / cadence / law
    slope, mean = np.polyfit(speed - speed.mean(), factor, 1)
    scatter = np.std(factor - mean - slope * (speed - speed.mean()), ddof=2)
    print(f"speed {speed.mean():.3f} sd {speed.std(ddof=1):.3f} m/s")
    print(f"K {mean:.3f} + {slope:.3f} s/m (speed - mean), residual sd {scatter:.3f}")
    for c, name in enumerate(CHANNELS):
        slope = np.polyfit(np.log(speed), np.log(energy[:, c]), 1)[0]
        about = np.std(np.log(energy[:, c]) - slope * np.log(speed))
        print(f"{name}: exponent of speed {slope:.2f}, log sd of rms at a speed {about:.2f}")
    for name in ("residual_rms", "residual_hz", "gain_sd", "mean_sd"):
        values = np.array([np.median([getattr(r, name) for r in rows], axis=0) for rows in people.values()])
        print(name, np.median(values, axis=0).round(3))
    print(f"median log sd of a harmonic about its channel {np.median(log_sd):.2f}")


if __name__ == "__main__":
    main()
