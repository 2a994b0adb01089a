"""No steps: a device that is carried about and set down, ranges of uncalibrated links that are obstructed now and then.

    python bench/fusion_carried.py

`mine_loc` has the ranges and what dead reckoning makes of the simulated N100; `mine_loc_ranges` the ranges alone, as
all others. Errors are in space. InertialSettings was chosen on the tuning seeds (`--tune`), then the rest was run.
"""

import argparse
import itertools
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from fusion_walks import START_NS, rounds_of, scene, seeds
from rich.progress import track
from uwb_tracks import Array

from mine_loc_core.stamps import NS_PER_S, to_ns
from mine_loc_fusion.estimate import EpochInputs, StepFix, VelocityChange
from mine_loc_fusion.inertial_prediction import InertialSettings
from mine_loc_fusion.late_inputs import LateInputCorrector
from mine_loc_fusion.tightly_coupled import TightlyCoupled
from mine_loc_fusion.tightly_coupled_settings import TightlyCoupledSettings
from mine_loc_pdr.dead_reckoning import ImuSample, PedestrianDeadReckoning
from mine_loc_pdr.fdilink import ImuFrame
from mine_loc_pdr.n100_axes import flu_from_frd
from mine_loc_pdr.stride import PendulumStrideModel
from mine_loc_sim.gait import IrregularMotion, control_instants_s
from mine_loc_sim.imu_errors import draw_device
from mine_loc_sim.magnetic_field import GalleryField
from mine_loc_sim.n100_device import N100Device
from mine_loc_sim.route import Pose
from mine_loc_sim.smooth_curve import SmoothCurve
from mine_loc_sim.waist_motion import StampArray, WaistMotion, compose
from mine_loc_uwb.fix import FixStatus
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.parameters import UwbSolverParameters
from mine_loc_uwb.solvers import RANGE_SOLVERS

_TILT_PEAK_HZ = 0.5
_TURN_SD_RAD = 1.0
HISTORY_NS = 2 * NS_PER_S


@dataclass(frozen=True, slots=True)
class Carrying:
    """One run: rounds with the truth at them (n, 3), and what dead reckoning says, in order of arrival."""

    rounds: list[Measurements]
    truth_m: Array
    inertial: list[tuple[int, EpochInputs]]
    """(arrival, epoch)."""


class Carried:
    """A device on its way; see `Walker.motion`."""

    def __init__(self, of: Mapping[str, Any], rng: np.random.Generator) -> None:
        count = math.ceil(of["duration_s"] / of["control_s"]) + 1
        controls = np.column_stack([rng.uniform(*of["box_m"], (count, 3)), _TURN_SD_RAD * rng.standard_normal(count)])
        first, last = (int(at / of["control_s"]) for at in of["still_s"])
        controls[first : last + 1] = controls[first]
        self._way = SmoothCurve(0.0, of["control_s"], controls)
        instants = control_instants_s(_TILT_PEAK_HZ, of["duration_s"])
        deviation = np.zeros((len(instants), 6))
        moving = (instants < of["still_s"][0]) | (instants > of["still_s"][1])
        deviation[np.ix_(moving, [3, 4])] = of["tilt_rate_rad_s"]
        self._tilt = IrregularMotion(rng, _TILT_PEAK_HZ, deviation)

    def motion(self, stamp_ns: StampArray) -> WaistMotion:
        """True motion at instants (n,)."""
        t_s = (stamp_ns - START_NS) / NS_PER_S
        value, rate, bend = (self._way(t_s, derivative) for derivative in range(3))
        path = Pose(value[:, :3], rate[:, :3], bend[:, :3], value[:, 3], rate[:, 3], bend[:, 3])
        return compose(stamp_ns, path, self._tilt.at(t_s), 0.0)


def carry(of: Mapping[str, Any], seed: int) -> Carrying:
    """Play one run."""
    way, worn, device, field, radio, episodes, biases = np.random.default_rng(seed).spawn(7)
    carried, stop_ns = Carried(of, way), START_NS + to_ns(of["duration_s"])
    stamp_ns = np.arange(START_NS, stop_ns, to_ns(of["period_s"]))
    motion = carried.motion(stamp_ns)
    blocked_m = _episodes_m(of, (stamp_ns - START_NS) / NS_PER_S, episodes)
    rounds = rounds_of(of, stamp_ns, motion.position_m, motion.heading_rad, blocked_m, radio)
    bias_m = of["link_bias_sd_m"] * biases.standard_normal(len(of["anchors_m"]))
    rounds = [_in_space(each, bias_m) for each in rounds]
    n100 = N100Device(draw_device(worn), carried, GalleryField(field), device)  # type: ignore[arg-type]
    return Carrying(rounds, motion.position_m, list(_dead_reckoned(n100, stop_ns)))


def _in_space(each: Measurements, bias_m: Array) -> Measurements:
    """The round with the error of each link, height unknown."""
    range_m = each.range_m + bias_m[each.anchor_ids.astype(int) - 1]
    return Measurements(
        each.stamp_ns, each.anchor_ids, each.anchors_m, range_m, each.variance_m2, each.since_s, each.los_probability,
        each.receive_power_dbm,
    )  # fmt: skip


def _episodes_m(of: Mapping[str, Any], t_s: Array, rng: np.random.Generator) -> Array:
    """Excess way (rounds, anchors), rising and falling in each episode."""
    blocked = of["blocked"]
    detour_m = np.zeros((len(t_s), len(of["anchors_m"])))
    for link in range(detour_m.shape[1]):
        at_s = rng.exponential(blocked["every_s"])
        while at_s < t_s[-1]:
            lasts_s = rng.uniform(*blocked["lasts_s"])
            along = (t_s - at_s) / lasts_s
            inside = (along > 0.0) & (along < 1.0)
            largest_m = blocked["detour_m"] * rng.uniform(0.3, 1.7)
            detour_m[inside, link] = largest_m * np.sin(np.pi * along[inside])
            at_s += lasts_s + rng.exponential(blocked["every_s"])
    return detour_m


def _dead_reckoned(n100: N100Device, stop_ns: int) -> Iterator[tuple[int, EpochInputs]]:
    pdr = PedestrianDeadReckoning(PendulumStrideModel(1.75))
    for stamp_ns, frame in n100.frames(stop_ns):
        if isinstance(frame, ImuFrame):
            rate, force = flu_from_frd(frame.angular_velocity_rad_s), flu_from_frd(frame.specific_force_m_s2)
            yield from dead_reckoned(pdr, ImuSample(stamp_ns, rate, force))


def dead_reckoned(pdr: PedestrianDeadReckoning, sample: ImuSample) -> Iterator[tuple[int, EpochInputs]]:
    """(arrival, epoch) of the steps or the change of velocity that a sample completes."""
    for step in pdr.push(sample):
        interval_s = math.nan if step.interval_s is None else step.interval_s
        fix = StepFix(step.length_m, step.length_variance_m2, step.heading_rad, step.heading_variance_rad2, interval_s)
        yield sample.stamp_ns, EpochInputs(step.stamp_ns, steps=(fix,))
    if pdr.velocity_change is not None:
        change = VelocityChange(np.array(pdr.velocity_change.change_m_s), pdr.velocity_change.interval_s)
        yield sample.stamp_ns, EpochInputs(sample.stamp_ns, velocity_changes=(change,))


def fused(
    rounds: list[Measurements],
    inertial: list[tuple[int, EpochInputs]],
    settings: InertialSettings | None = None,
    *,
    height_m: float = 1.2,
    systematic_sd_m: float = 0.0,
) -> Iterator[tuple[int, Array, Array]]:
    """Stamp of each round, place (3,) and horizontal covariance (2, 2) by the default estimator."""
    given = TightlyCoupledSettings(inertial=settings or InertialSettings())
    carried = replace(given.carried, systematic_sd_m=systematic_sd_m)
    alone = replace(given.alone, systematic_sd_m=systematic_sd_m)
    chosen = replace(given, carried=carried, alone=alone)
    estimator = LateInputCorrector(TightlyCoupled(chosen, height_m), HISTORY_NS)
    epochs = [(each.stamp_ns, EpochInputs(each.stamp_ns, ranges=(each,))) for each in rounds]
    for arrival_ns, inputs in sorted(epochs + inertial, key=lambda item: item[0]):
        estimator.update(inputs)
        estimate = estimator.estimate(arrival_ns)
        if inputs.ranges and estimate is not None:
            place_m = np.append(estimate.position_m, estimate.height_m or 0.0)
            yield arrival_ns, place_m, estimate.covariance[:2, :2]


def solved(name: str, rounds: list[Measurements]) -> Iterator[tuple[int, Array]]:
    """Places by a solver of mine_loc_uwb with its defaults."""
    solving = RANGE_SOLVERS[name](UwbSolverParameters())
    for each in rounds:
        fix = solving.solve(each).fix
        if fix.status is FixStatus.OK:
            yield each.stamp_ns, fix.position_m


def rmse_m(run: Carrying, places: list[tuple[int, Array]]) -> float:
    """In space, over the rounds that got a place."""
    truth = {each.stamp_ns: at for each, at in zip(run.rounds, run.truth_m, strict=True)}
    return float(np.sqrt(np.mean([np.sum((at - truth[stamp_ns]) ** 2) for stamp_ns, at in places])))


def nees(run: Carrying, found: list[tuple[int, Array, Array]]) -> float:
    """Mean normalised estimation error squared, horizontal: 2 degrees of freedom."""
    truth = {each.stamp_ns: at[:2] for each, at in zip(run.rounds, run.truth_m, strict=True)}
    errors = [(place[:2] - truth[stamp_ns], spread) for stamp_ns, place, spread in found]
    return float(np.mean([error @ np.linalg.solve(spread, error) for error, spread in errors]))


def run() -> dict[str, dict[str, float]]:
    """Each row over the scored seeds; what stays of the links' errors is told to the estimator, and what it claims."""
    of = scene("carried")
    found: dict[str, list[float]] = {name: [] for name in ("mine_loc", "mine_loc_ranges", *RANGE_SOLVERS)}
    consistency: dict[str, list[float]] = {"mine_loc": [], "mine_loc_ranges": []}
    for seed in seeds(of, "seeds"):
        each = carry(of, seed)
        for name, inertial in (("mine_loc", each.inertial), ("mine_loc_ranges", [])):
            track_of = list(fused(each.rounds, inertial, systematic_sd_m=of["link_bias_sd_m"]))
            found[name].append(rmse_m(each, [(at, place) for at, place, _ in track_of]))
            consistency[name].append(nees(each, track_of))
        for name in RANGE_SOLVERS:
            found[name].append(rmse_m(each, list(solved(name, each.rounds))))
    rows = {
        name: {
            "rmse_m": float(np.mean(row)),
            "median_rmse_m": float(np.median(row)),
            "ci95_m": float(1.96 * np.std(row, ddof=1) / math.sqrt(len(row))),
        }
        for name, row in found.items()
    }
    for name, values in consistency.items():
        rows[name] |= {"mean_nees": float(np.mean(values)), "median_nees": float(np.median(values))}
    better = np.array(found["mine_loc_ranges"]) - np.array(found["mine_loc"])
    rows["mine_loc"]["less_than_ranges_m"] = float(better.mean())
    rows["mine_loc"]["less_than_ranges_ci95_m"] = float(1.96 * better.std(ddof=1) / math.sqrt(len(better)))
    return rows


_GRID = {
    "noise_density_m2_s3": [0.02**2, 0.05**2, 0.1**2],
    "horizontal_error_sd_m_s2": [0.05, 0.1, 0.15, 0.25],
    "horizontal_error_time_s": [2.0, 5.0, 15.0],
    "vertical_error_sd_m_s2": [0.05, 0.15],
}


def tune() -> None:
    """Mean RMSE of each candidate over the tuning seeds, best first."""
    of = scene("carried")
    runs = [carry(of, seed) for seed in seeds(of, "tuning_seeds")]

    def score_m(settings: InertialSettings) -> float:
        tracks = [[(at, place) for at, place, _ in fused(each.rounds, each.inertial, settings)] for each in runs]
        return float(np.mean([rmse_m(each, places) for each, places in zip(runs, tracks, strict=True)]))

    print("ranges alone", np.mean([rmse_m(e, [(a, p) for a, p, _ in fused(e.rounds, [])]) for e in runs]))
    candidates = [dict(zip(_GRID, values, strict=True)) for values in itertools.product(*_GRID.values())]
    scores = [(score_m(InertialSettings(**each)), each) for each in track(candidates)]
    for score, each in sorted(scores, key=lambda item: item[0])[:12]:
        print(f"{score:.4f} {each}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tune", action="store_true", help="choose InertialSettings on the tuning seeds")
    if parser.parse_args().tune:
        tune()
    else:
        print(json.dumps(run(), indent=2))
