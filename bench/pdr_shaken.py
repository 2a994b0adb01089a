"""False steps a minute of drawn rides, with other draws than those the network was trained on, by both detectors."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from gait_recordings import Array
from pdr_tracks import shipped_detector, spread

from mine_loc_pdr.shaking import band_noise
from mine_loc_pdr.step_frames import FRAME_NS
from mine_loc_pdr.steps import PeakStepDetector, StepDetector

BANDS_HZ = ((1.0, 4.0), (1.0, 8.0), (2.0, 8.0), (4.0, 20.0))
VERTICAL_M_S2 = (0.3, 0.6, 1.0, 1.5)  # rms; half of it in each level direction
ROCKING_RAD_S = (0.05, 0.15, 0.3)  # rms about each axis
SEEDS = range(100, 105)
_MINUTE_FRAMES = 3000
_DETECTORS: Mapping[str, Callable[[], StepDetector]] = {
    "false_steps_per_min": shipped_detector,
    "adapting_thresholds": PeakStepDetector,
}


def shaken() -> dict[str, Any]:
    """Mean and spread over the seeds for each band, strength and rocking."""
    return {
        f"{low:g}_to_{high:g}_hz": {
            f"{rms:g}_m_s2_{rocking:g}_rad_s": {
                name: spread([_steps(detector(), _ride(seed, (low, high), rms, rocking)) for seed in SEEDS], 1)
                for name, detector in _DETECTORS.items()
            }
            for rms in VERTICAL_M_S2
            for rocking in ROCKING_RAD_S
        }
        for low, high in BANDS_HZ
    }


def _ride(seed: int, band_hz: tuple[float, float], rms_m_s2: float, rocking_rad_s: float) -> Array:
    rng = np.random.default_rng(seed)
    gains = (rms_m_s2, 0.5 * rms_m_s2, 0.5 * rms_m_s2, *[rocking_rad_s] * 3)
    return np.column_stack([gain * band_noise(rng, _MINUTE_FRAMES, *band_hz) for gain in gains])


def _steps(detector: StepDetector, motion: Array) -> int:
    rows = (tuple(map(float, row)) for row in motion)
    return sum(len(detector.push(k * FRAME_NS, row)) for k, row in enumerate(rows, 1))
