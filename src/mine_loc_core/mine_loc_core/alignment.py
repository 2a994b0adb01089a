"""Laying a track over its truth: one time offset and one rigid transform in the horizontal plane.

Truth often has its own clock and frame. Only a rotation about the vertical and a shift are allowed: a free rotation in
space could turn a track upside down, which hides a mirrored solution.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Alignment:
    """map = R(yaw) · truth + shift, at truth time = track time + `time_offset_s`."""

    time_offset_s: float
    yaw_rad: float
    shift_m: Array

    def apply(self, truth_m: Array) -> Array:
        """Truth positions (n, 2) in the frame of the track."""
        return truth_m @ _rotation(self.yaw_rad).T + self.shift_m

    def as_json(self) -> dict[str, object]:
        """Of plain types, the angle in degrees."""
        yaw_deg, shift_m = float(np.degrees(self.yaw_rad)), self.shift_m.tolist()
        return {"time_offset_s": self.time_offset_s, "yaw_deg": yaw_deg, "shift_m": shift_m}


def rigid_2d(source_m: Array, target_m: Array) -> tuple[float, Array]:
    """Yaw and shift that lay `source_m` (n, 2) over `target_m` (n, 2) with least squared distance."""
    source_mean, target_mean = source_m.mean(axis=0), target_m.mean(axis=0)
    a, b = source_m - source_mean, target_m - target_mean
    yaw = float(np.arctan2(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), np.sum(a * b)))
    return yaw, target_mean - _rotation(yaw) @ source_mean


def align(
    times_s: Array, track_m: Array, truth_times_s: Array, truth_m: Array, *, search_s: float, rigid: bool = True
) -> Alignment:
    """The offset within ± `search_s` and the transform (none unless `rigid`) with the least RMS distance.

    `track_m` is (n, 2) at `times_s`, `truth_m` (m, 2) at `truth_times_s`, which increase. Instants without truth are
    left out; an offset that leaves less than half of them is not considered. Raises ValueError when none is left.
    """

    def fit(offset_s: float) -> tuple[float, float, Array]:
        inside = (times_s + offset_s >= truth_times_s[0]) & (times_s + offset_s <= truth_times_s[-1])
        if inside.sum() < len(times_s) / 2:
            return np.inf, 0.0, np.zeros(2)
        truth = truth_at(times_s[inside] + offset_s, truth_times_s, truth_m)
        yaw, shift = rigid_2d(truth, track_m[inside]) if rigid else (0.0, np.zeros(2))
        residual = track_m[inside] - (truth @ _rotation(yaw).T + shift)
        return float(np.sqrt(np.mean(np.sum(residual**2, axis=1)))), yaw, shift

    step_s = 0.05
    grid = np.linspace(-search_s, search_s, 2 * round(search_s / step_s) + 1)
    coarse_s = float(grid[np.argmin([fit(offset)[0] for offset in grid])])
    if not np.isfinite(fit(coarse_s)[0]):
        raise ValueError(f"truth covers less than half of the track at every time offset within ± {search_s:g} s")
    low_s, high_s = max(coarse_s - step_s, -search_s), min(coarse_s + step_s, search_s)
    offset_s = coarse_s
    if high_s > low_s:
        found = minimize_scalar(lambda offset: fit(offset)[0], bounds=(low_s, high_s), method="bounded")
        offset_s = float(found.x)
    _, yaw, shift = fit(offset_s)
    return Alignment(offset_s, yaw, shift)


def truth_at(times_s: Array, truth_times_s: Array, truth_m: Array) -> Array:
    """Truth (n, 2) interpolated to `times_s`, NaN before its start and after its end."""
    return np.column_stack(
        [np.interp(times_s, truth_times_s, truth_m[:, axis], left=np.nan, right=np.nan) for axis in range(2)]
    )


def _rotation(yaw: float) -> Array:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s], [s, c]])
