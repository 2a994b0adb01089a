"""What the UWB benches share: rounds of ranges into solvers, tracks out, errors with their spread."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.stamps import to_ns
from mine_loc_uwb.fix import FixStatus
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.solver import Solver

Array = NDArray[np.float64]
MakeSolver = Callable[[], Solver]


@dataclass(frozen=True, slots=True)
class Track:
    """Fixes at `times_s` (n,), positions (n, 2) and the horizontal covariance claimed (n, 2, 2)."""

    times_s: Array
    positions_m: Array
    covariances_m2: Array


def measurements_of(
    time_s: float,
    anchors_m: Array,
    range_m: Array,
    *,
    sd_m: float,
    height_m: float | None,
    ids: Sequence[int] | None = None,
    since_s: Array | None = None,
    los_probability: Array | None = None,
) -> Measurements:
    """One round of ranges; NaN, negative and zero ones are left out, as the node does."""
    good = np.isfinite(range_m) & (range_m > 0.0)
    numbers = np.arange(1, len(range_m) + 1) if ids is None else np.asarray(ids)
    count = int(good.sum())
    return Measurements(
        stamp_ns=to_ns(time_s),
        anchor_ids=numbers[good].astype(np.uint64),
        anchors_m=anchors_m[good],
        range_m=range_m[good],
        variance_m2=np.full(count, sd_m**2),
        since_s=np.zeros(count) if since_s is None else since_s[good],
        los_probability=np.full(count, np.nan) if los_probability is None else los_probability[good],
        receive_power_dbm=np.full(count, np.nan),
        height_m=height_m,
    )


def run_solver(make_solver: MakeSolver, rounds: Sequence[Measurements]) -> Track:
    """The fixes of one solver over rounds in order."""
    solver = make_solver()
    fixes = [(each.stamp_ns / 1e9, solver.solve(each).fix) for each in rounds]
    good = [(time_s, fix) for time_s, fix in fixes if fix.status is FixStatus.OK]
    return Track(
        np.array([time_s for time_s, _ in good]),
        np.array([fix.position_m[:2] for _, fix in good]).reshape(-1, 2),
        np.array([fix.covariance_m2[:2, :2] for _, fix in good]).reshape(-1, 2, 2),
    )


def spread(values: Sequence[float]) -> dict[str, float]:
    """Mean over runs, standard deviation over runs, number of runs."""
    return {"mean": float(np.mean(values)), "sd": float(np.std(values, ddof=1)), "n": len(values)}
