"""The front of the body found from walking: recordings turned by random rotations, as if the sensor sat anyhow.

The one learnt number, the lag of the forward acceleration, is that of the other people.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any
from unittest.mock import patch

import numpy as np
from gait_recordings import Array
from pdr_recordings import Recording

from mine_loc_core import quaternion
from mine_loc_pdr import dead_reckoning, mounting
from mine_loc_pdr.dead_reckoning import ImuSample, PedestrianDeadReckoning
from mine_loc_pdr.mounting import FrontEstimate, FrontFinder, forward_push
from mine_loc_pdr.steps import StepDetector
from mine_loc_pdr.stride import PendulumStrideModel

Steps = list[tuple[Array, Array]]  # phase (n,) and level motion (n, 3) of each step


def gathered(recording: Recording, q: Array, detector: StepDetector) -> tuple[Steps, float]:
    """What dead reckoning hands to the finder where the sensor is turned by `q`, and the true yaw of the front."""
    steps: Steps = []

    def keep(phase_rad: Array, motion_m_s2: Array) -> complex:
        steps.append((phase_rad, motion_m_s2))
        return forward_push(phase_rad, motion_m_s2)

    pdr = PedestrianDeadReckoning(PendulumStrideModel(1.75), detector=detector)
    rate, force = quaternion.rotate(q, recording.rate_rad_s), quaternion.rotate(q, recording.force_m_s2)
    with patch.object(dead_reckoning, "forward_push", keep):
        for stamp_ns, w, f in zip(recording.stamps_ns.tolist(), rate.tolist(), force.tolist(), strict=True):
            pdr.push(ImuSample(stamp_ns, tuple(w), tuple(f)))
    supposed = pdr.mounting(0.0)
    assert supposed is not None
    east, north, _ = quaternion.rotate(supposed, quaternion.rotate(q, (1.0, 0.0, 0.0)))
    return steps, math.atan2(north, east)


def lag_rad(walks: Sequence[tuple[Steps, float]]) -> float:
    """Lag of the acceleration along the true front behind the vertical one, of one person."""
    total = 0j
    for steps, yaw_rad in walks:
        for phase_rad, motion in steps:
            front, left, up = np.exp(-1j * phase_rad) @ motion / len(phase_rad)
            total += np.conj(up) * (math.cos(yaw_rad) * front + math.sin(yaw_rad) * left)
    return float(np.angle(total))


def found(steps: Steps, lag: float) -> FrontEstimate | None:
    """The estimate after these steps with this lag."""
    finder = FrontFinder()
    with patch.object(mounting, "FORWARD_PHASE_RAD", lag):
        for phase_rad, motion in steps:
            finder.add(forward_push(phase_rad, motion))
    return finder.estimate()


def ipol(recordings: Sequence[Recording], detector: Callable[[Recording], StepDetector]) -> dict[str, Any]:
    """A random rotation a recording; after the first ten steps, and after all."""
    rng = np.random.default_rng(6)
    walks = [gathered(r, quaternion.normalise(rng.standard_normal(4)), detector(r)) for r in recordings]
    people = np.array([r.person for r in recordings])
    lags = {p: lag_rad([w for w, own in zip(walks, people == p, strict=True) if own]) for p in np.unique(people)}
    rows: dict[str, Any] = {"lags_deg": [round(math.degrees(lag)) for lag in lags.values()]}
    for name, first in (("after_ten_steps", 10), ("after_all_steps", None)):
        errors, normalised = [], []
        for (steps, true_rad), person in zip(walks, people, strict=True):
            lag = float(np.angle(sum(np.exp(1j * lag) for other, lag in lags.items() if other != person)))
            estimate = found(steps[:first], lag)
            if estimate is None:
                continue
            errors.append(math.degrees(math.remainder(estimate.yaw_rad - true_rad, math.tau)))
            normalised.append(math.radians(errors[-1]) ** 2 / estimate.variance_rad2)
        rows[name] = {
            "found": len(errors),
            "of": len(walks),
            "yaw_error_median_deg": round(float(np.median(np.abs(errors))), 2),
            "yaw_error_mean_deg": round(float(np.mean(errors)), 2),
            "yaw_error_sd_deg": round(float(np.std(errors)), 2),
            "yaw_error_max_deg": round(float(np.max(np.abs(errors))), 1),
            "error_squared_over_variance": round(float(np.mean(normalised)), 2),
        }
    return rows
