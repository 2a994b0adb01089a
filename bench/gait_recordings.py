"""The lower-back recordings of ipol_gait_lowerback as level FLU samples with their marked heel strikes and U-turn."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from mine_loc_bringup.recordings import ipol
from mine_loc_bringup.recordings.ipol import WALKED_M
from mine_loc_sim.gait_constants import SPEED_CHANGE_M_S2

Array = npt.NDArray[np.float64]
RATE_HZ = 100.0
STEADY_MARGIN_S = 1.5  # starts, stops and the U-turn's own steps are not steady walking


@dataclass(frozen=True, slots=True)
class Walk:
    """One trial: stand, 10 m, U-turn, 10 m, stop. Instants are sample indices at RATE_HZ."""

    subject: int
    trial: int
    height_m: float | None
    specific_force: Array  # (n, 3) m/s², forward-left-up, level while walking
    rate: Array  # (n, 3) rad/s, same axes
    left_strike: npt.NDArray[np.int64]
    right_strike: npt.NDArray[np.int64]
    start: int
    turn_start: int
    turn_stop: int
    stop: int

    def steady(self) -> tuple[slice, slice]:
        """The two stretches of straight, steady walking."""
        margin = int(STEADY_MARGIN_S * RATE_HZ)
        return slice(self.start + margin, self.turn_start - margin // 2), slice(
            self.turn_stop + margin // 2, self.stop - margin
        )


def level(walk: Walk) -> Walk:
    """Turn FLU samples by the least angle that makes the mean specific force of steady walking vertical.

    Steady walking has no mean acceleration, so its mean specific force is gravity's reaction alone.
    """
    mean = np.concatenate([walk.specific_force[w] for w in walk.steady()]).mean(axis=0)
    up = mean / np.linalg.norm(mean)
    forward = np.array([1.0, 0.0, 0.0]) - up[0] * up
    forward /= np.linalg.norm(forward)
    axes = np.stack([forward, np.cross(up, forward), up])
    return replace(walk, specific_force=walk.specific_force @ axes.T, rate=walk.rate @ axes.T)


def steady_speed(walk: Walk) -> float:
    """Speed v at which a start, a reversal and a stop fit the trial's duration: WALKED_M / v + 2 v / a = duration."""
    duration_s = (walk.stop - walk.start) / RATE_HZ
    a = SPEED_CHANGE_M_S2
    return (duration_s - float(np.sqrt(duration_s**2 - 8 * WALKED_M / a))) * a / 4


def on_counter_grid(table: Array) -> Array:
    """Rows put where their packet counter (column 0) says, lost packets filled in linearly.

    61 of the 76 files lack rows, 5 % of all and mostly after the U-turn; the marks count packets, not rows.
    """
    counter, first = np.unique(table[:, 0], return_index=True)
    grid = np.arange(counter[0], counter[-1] + 1)
    return np.stack([np.interp(grid, counter, column) for column in table[first].T], axis=1)


def load(folder: Path, name: str) -> Walk:
    """Read trial `name` ("subject-trial")."""
    trial = ipol.read_trial(folder, name)
    samples = trial.samples
    table = on_counter_grid(np.column_stack([samples.counter, samples.force_m_s2, samples.rate_rad_s]))
    still = slice(20, max(60, trial.begin - 50))
    walk = Walk(
        subject=trial.subject,
        trial=trial.number,
        height_m=trial.height_m,
        specific_force=table[:, 1:4],
        rate=table[:, 4:7] - table[still, 4:7].mean(axis=0),
        left_strike=trial.left_strikes,
        right_strike=trial.right_strikes,
        start=trial.begin,
        turn_start=trial.turn_begin,
        turn_stop=trial.turn_end,
        stop=trial.end,
    )
    return level(walk)


def walks(folder: Path, *, odd_subjects: bool) -> Iterator[Walk]:
    """All trials of the odd subjects (calibration) or of the even ones (scored)."""
    for name in ipol.names(folder):
        if int(name.split("-")[0]) % 2 == int(odd_subjects):
            yield load(folder, name)
