"""Heading over a U-turn and the way back to the start, beside plain gyro integration, imufusion and ahrs."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import ahrs
import imufusion
import numpy as np
from gait_recordings import RATE_HZ, Array
from pdr_recordings import STANDARD_GRAVITY_M_S2, Recording
from pdr_tracks import HALT_S, Track, inside, spread

from mine_loc_pdr.attitude import AttitudeFilter, turned

_LEVELLING_S = 0.5  # at the start, for the first horizon, as dead reckoning takes it
_STANDING_S = 3.0  # nobody walks before: peers are given the gyro's bias, which ours has to find
Heading = tuple[Array, Array]  # times in s, heading in rad, unwrapped


def unbiased(recording: Recording) -> Array:
    """Rates less the mean of the first seconds, (n, 3) rad/s."""
    return recording.rate_rad_s - recording.rate_rad_s[: int(_STANDING_S * RATE_HZ)].mean(axis=0)


def plain_gyro(recording: Recording) -> Heading:
    """The turn rate about the vertical of the start, integrated: no gravity afterwards."""
    times_s = recording.samples_s
    up = recording.force_m_s2[: int(_LEVELLING_S * RATE_HZ)].mean(axis=0)
    rate = unbiased(recording) @ (up / np.linalg.norm(up))
    return times_s, np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(times_s))])


def paper_b(recording: Recording) -> Heading:
    """Its quaternion integration and heading (equations 4 to 6) from a level start: no bias, no gravity afterwards."""
    times_s = recording.samples_s
    fx, fy, fz = recording.force_m_s2[: int(_LEVELLING_S * RATE_HZ)].mean(axis=0).tolist()
    q = AttitudeFilter((fx, fy, fz)).orientation_imu
    yaw = []
    for dt_s, rate in zip(np.diff(times_s, prepend=times_s[0]).tolist(), recording.rate_rad_s.tolist(), strict=True):
        q = turned(q, rate[0] * dt_s, rate[1] * dt_s, rate[2] * dt_s)
        w, x, y, z = q
        yaw.append(math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))
    return times_s, np.unwrap(yaw)


def with_imufusion(recording: Recording) -> Heading:
    """Its AHRS and its bias estimator with their default settings."""
    times_s = recording.samples_s
    fusion, bias = imufusion.Ahrs(), imufusion.Bias()
    gyro, force = np.degrees(unbiased(recording)), recording.force_m_s2 / STANDARD_GRAVITY_M_S2
    yaw = []
    for dt_s, rate, acceleration in zip(np.diff(times_s, prepend=times_s[0] - 1.0 / RATE_HZ), gyro, force, strict=True):
        fusion.set_sample_period(float(dt_s))
        fusion.update_no_magnetometer(bias.update(rate), acceleration)
        yaw.append(imufusion.quaternion_to_euler(fusion.get_quaternion())[2])
    return times_s, np.unwrap(np.radians(yaw))


def with_ahrs(recording: Recording) -> Heading:
    """Its Madgwick filter, default gain, on a grid with lost rows filled in."""
    times_s = recording.samples_s
    grid_s = np.arange(times_s[0], times_s[-1], 1.0 / RATE_HZ)

    def on_grid(table: Array) -> Array:
        return np.stack([np.interp(grid_s, times_s, column) for column in table.T], axis=1)

    q = ahrs.filters.Madgwick(gyr=on_grid(unbiased(recording)), acc=on_grid(recording.force_m_s2), frequency=RATE_HZ).Q
    w, x, y, z = q.T
    return grid_s, np.unwrap(np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


PEERS: Mapping[str, Callable[[Recording], Heading]] = {
    "plain_gyro": plain_gyro,
    "paper_b_quaternion": paper_b,
    "imufusion": with_imufusion,
    "ahrs_madgwick": with_ahrs,
}


def turn_error_deg(recording: Recording, heading: Heading) -> float:
    """|mean heading out − mean heading back| − 180°, of the samples; people do not turn by 180° exactly."""
    assert recording.turn is not None
    times_s, heading_rad = heading
    ((begin, end, _),) = recording.bouts
    out = heading_rad[(times_s >= begin) & (times_s < recording.turn[0])].mean()
    back = heading_rad[(times_s > recording.turn[1]) & (times_s <= end)].mean()
    return float(abs(np.degrees(back - out)) - 180.0)


def steps_turn_error_deg(recording: Recording, track: Track) -> float:
    """The same of the directions of the steps, each the mean facing over one step."""
    unwrapped = np.unwrap([step.heading_rad for step in track.steps])
    return turn_error_deg(recording, (track.steps_s, unwrapped))


def return_error_m(recording: Recording, track: Track, stretch: float) -> float:
    """From the start to the position at the end of the trial, the steps' length times `stretch`."""
    last = np.flatnonzero(inside(track.steps_s, recording.bouts, HALT_S))[-1]
    return stretch * float(np.hypot(track.steps[last].x_m, track.steps[last].y_m))


def _turn(errors: Sequence[float]) -> dict[str, float]:
    return {
        "uturn_error_median_deg": round(float(np.median(np.abs(errors))), 2),
        "uturn_error_mean_deg": round(float(np.mean(errors)), 2),
        "uturn_error_sd_deg": round(float(np.std(errors)), 2),
    }


def ipol(recordings: Sequence[Recording], tracks: Sequence[Track], stretch: Mapping[str, float]) -> dict[str, Any]:
    """`stretch`: for each person the step-length factor of the others over the shipped one."""
    pairs = list(zip(recordings, tracks, strict=True))
    back = [return_error_m(r, t, stretch[r.person]) for r, t in pairs]
    rows = _turn([steps_turn_error_deg(r, t) for r, t in pairs])
    rows |= {"return_error_m": round(float(np.median(back)), 2), "return_error": spread(back)}
    rows["of_samples"] = _turn([turn_error_deg(r, (t.times_s, t.heading_rad)) for r, t in pairs])
    return rows | {name: _turn([turn_error_deg(r, peer(r)) for r in recordings]) for name, peer in PEERS.items()}
