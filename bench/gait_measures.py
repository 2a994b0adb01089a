"""Figures of one recorded or simulated walk, the same computation for both."""

import itertools

import numpy as np
from gait_recordings import RATE_HZ, Array, Walk
from scipy.signal import butter, find_peaks, sosfiltfilt

PHASE_POINTS = 64
AXES = ("forward", "left", "up")
TURNS = ("roll", "pitch", "yaw")


def strides(walk: Walk) -> tuple[Array, Array]:
    """Steady strides on a phase grid from left strike to left strike, (n, PHASE_POINTS, 6), and durations in s.

    The right heel strike is put at half the stride.
    """
    samples = np.hstack([walk.specific_force, walk.rate])
    index = np.arange(len(samples))
    phase = np.linspace(0, 2, PHASE_POINTS, endpoint=False)
    waves, durations = [], []
    for window in walk.steady():
        left = walk.left_strike[(walk.left_strike >= window.start) & (walk.left_strike < window.stop)]
        for a, b in itertools.pairwise(left):
            between = walk.right_strike[(walk.right_strike > a) & (walk.right_strike < b)]
            if len(between) == 1 and 60 < b - a < 180:
                at = np.interp(phase, [0, 1, 2], [a, between[0], b])
                waves.append(np.stack([np.interp(at, index, column) for column in samples.T], axis=1))
                durations.append((b - a) / RATE_HZ)
    return np.array(waves), np.array(durations)


def step_times(walk: Walk) -> tuple[Array, Array]:
    """Durations in s of the steady steps that end on the left and on the right foot."""
    marks = sorted([(t, 0) for t in walk.left_strike] + [(t, 1) for t in walk.right_strike])
    ending: tuple[list[float], list[float]] = ([], [])
    for window in walk.steady():
        for (t0, foot0), (t1, foot1) in itertools.pairwise(marks):
            if foot0 != foot1 and window.start <= t0 and t1 < window.stop and 30 < t1 - t0 < 90:
                ending[foot1].append((t1 - t0) / RATE_HZ)
    return np.array(ending[0]), np.array(ending[1])


def line_rms(walk: Walk, channel: int, frequency_hz: float) -> float:
    """Rms of one channel of the specific force within ±0.25 Hz of a frequency, over the steady walking."""
    power = []
    for window in walk.steady():
        x = walk.specific_force[window, channel]
        taper = np.hanning(len(x))
        spectrum = np.abs(np.fft.rfft((x - x.mean()) * taper, 4096)) ** 2
        density = 2 * spectrum / (RATE_HZ * np.sum(taper**2))
        f = np.fft.rfftfreq(4096, 1 / RATE_HZ)
        power.append(density[np.abs(f - frequency_hz) <= 0.25].sum() * (f[1] - f[0]))
    return float(np.sqrt(np.mean(power)))


def harmonic_ratio(waves: Array, channel: int, *, in_phase_even: bool) -> float:
    """In-phase over out-of-phase amplitudes of the stride's first 20 harmonics, mean over strides (Menz 2003)."""
    amplitude = np.abs(np.fft.rfft(waves[:, :, channel], axis=1))[:, 1:21]
    odd, even = amplitude[:, 0::2].sum(axis=1), amplitude[:, 1::2].sum(axis=1)
    return float(np.mean(even / odd if in_phase_even else odd / even))


def turn_figures(walk: Walk) -> dict[str, float]:
    """Peak turn rate (0.15 s mean), time from 5 % to 95 % of the angle, and angle of the U-turn."""
    around = slice(walk.turn_start - 60, walk.turn_stop + 60)
    yaw = np.convolve(walk.rate[:, 2], np.ones(15) / 15, "same")[around]
    angle = yaw.sum() / RATE_HZ
    done = np.maximum.accumulate(np.cumsum(yaw) / RATE_HZ / angle)
    ends = np.searchsorted(done, [0.05, 0.95])
    return {
        "turn_peak_rate_rad_s": float(np.abs(yaw).max()),
        "turn_duration_s": float(ends[1] - ends[0]) / RATE_HZ,
        "turn_angle_error_deg": float(abs(abs(np.degrees(angle)) - 180)),
    }


def count_steps(walk: Walk) -> int:
    """A plain step counter: peaks of the band-passed magnitude of the specific force, at least 0.3 s apart."""
    magnitude = np.linalg.norm(walk.specific_force, axis=1)
    band = butter(2, [0.5, 3.0], "bandpass", fs=RATE_HZ, output="sos")
    peaks, _ = find_peaks(sosfiltfilt(band, magnitude - magnitude.mean()), height=0.5, distance=int(0.3 * RATE_HZ))
    return len(peaks)


def measure(walk: Walk) -> dict[str, float] | None:
    """All figures of a walk; None when its marks hold no steady strides."""
    waves, _ = strides(walk)
    left, right = step_times(walk)
    if len(waves) < 4 or min(len(left), len(right)) < 4:
        return None
    steps = np.concatenate([left, right])
    step_hz = 1 / steps.mean()
    force = np.concatenate([walk.specific_force[w] for w in walk.steady()])
    rate = np.concatenate([walk.rate[w] for w in walk.steady()])
    marked = len(walk.left_strike) + len(walk.right_strike)
    counted = count_steps(walk)
    mean = waves.mean(axis=0)
    figures = {
        "step_frequency_hz": float(step_hz),
        "step_time_cv": float(np.concatenate([left - left.mean(), right - right.mean()]).std() / steps.mean()),
        "step_time_asymmetry": float(abs(left.mean() - right.mean()) / steps.mean()),
        "steps": float(marked),
        "walk_duration_s": (walk.stop - walk.start) / RATE_HZ,
    }
    figures |= {f"{name}_rms_m_s2": float(force[:, i].std()) for i, name in enumerate(AXES)}
    figures |= {f"{name}_rate_rms_rad_s": float(rate[:, i].std()) for i, name in enumerate(TURNS)}
    for name, channel, multiples in (("up", 2, (1, 2, 3, 4)), ("forward", 0, (1, 2, 3)), ("left", 1, (0.5, 1.5, 2.5))):
        figures |= {f"{name}_rms_at_{m:g}_step_hz_m_s2": line_rms(walk, channel, m * step_hz) for m in multiples}
    figures["up_rms_at_stride_m_s2"] = line_rms(walk, 2, step_hz / 2)
    figures |= {
        "up_harmonic_ratio": harmonic_ratio(waves, 2, in_phase_even=True),
        "forward_harmonic_ratio": harmonic_ratio(waves, 0, in_phase_even=True),
        "left_harmonic_ratio": harmonic_ratio(waves, 1, in_phase_even=False),
        "up_stride_residual_share": float((waves - mean)[:, :, 2].std() / mean[:, 2].std()),
        "counter_error_share": abs(counted - marked) / marked,
        "counter_bias_share": (counted - marked) / marked,
    }
    return figures | turn_figures(walk)
