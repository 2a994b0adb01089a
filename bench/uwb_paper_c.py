"""Paper C: six anchors on a vehicle, a person walking round it, plain multilateration against what follows it.

    python bench/uwb_paper_c.py

`spikes`: independent errors (bench/uwb_scenes/vehicle/spikes.yaml); `obstacles`: the simulator's channel with the
vehicle's own steel, metal things and the wearer's body in the way, so that errors last as long as what causes them;
links are judged as the node does without a classifier, by the powers the chip reports. Settings of the filters are
chosen on seeds of their own, from as many candidates each.
"""

import itertools
import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.optimize import least_squares as scipy_least_squares
from uwb_tracks import Array, MakeSolver, measurements_of, run_solver, spread

from mine_loc_core.site import Site, load_site
from mine_loc_core.verdicts import Reason
from mine_loc_sim.mine import Mine
from mine_loc_sim.radio_constants import INDUSTRIAL
from mine_loc_sim.range_law import FastTagLinks
from mine_loc_sim.ranging_link import Radios
from mine_loc_sim.site_mine import mine_of, vehicle_prism
from mine_loc_sim.wearer import Wearer
from mine_loc_uwb.fix import Fix, FixStatus
from mine_loc_uwb.least_squares import LeastSquares
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.received_power import los_probability_from_powers, odds_of_power_rule
from mine_loc_uwb.robust_tracker import RobustTracker
from mine_loc_uwb.solver import Solution
from mine_loc_uwb.tracker_settings import RobustTrackerSettings
from mine_loc_uwb.weighted_lm import WeightedLmFilter, WeightedLmSettings, advance

SCENE = Path(__file__).parent / "uwb_scenes" / "vehicle"
LAW: dict[str, Any] = yaml.safe_load((SCENE / "spikes.yaml").read_text("utf-8"))
SITE = load_site(SCENE)
ANCHORS_M = np.array([anchor.position_m for anchor in SITE.anchors])
BODY_M = (6.0, 2.5)
GIVEN_SD_M = {"spikes": LAW["range_sd_m"], "obstacles": 0.1}


@dataclass(frozen=True, slots=True)
class Run:
    """Truth (n, 2), ranges (n, 6), NaN = not heard, and what the powers say of the links, NaN = nothing."""

    truth_m: Array
    range_m: Array
    los_probability: Array


Scene = Callable[[int], Run]


def walk() -> tuple[Array, Array]:
    """Positions (n, 2) and course (n,) round the body, at constant speed and distance from it."""
    (length, width), off = BODY_M, LAW["off_body_m"]
    corner = 0.5 * math.pi * off
    legs = [length, corner, width, corner] * 2
    way_m = np.arange(LAW["points"]) * LAW["period_s"] * LAW["speed_m_s"] % sum(legs)
    start = np.concatenate([[0.0], np.cumsum(legs)])
    leg = np.searchsorted(start, way_m, side="right") - 1
    gone = way_m - start[leg]
    quarter = 0.5 * math.pi * (leg // 2)  # course along the straight leg, and at the beginning of a corner
    turned = np.where(leg % 2, gone / off, 0.0)
    course = quarter + turned
    along, aside = (
        np.column_stack([np.cos(quarter), np.sin(quarter)]),
        np.column_stack([np.sin(quarter), -np.cos(quarter)]),
    )
    half = 0.5 * np.where(leg // 2 % 2, width, length)[:, None]
    other = 0.5 * np.where(leg // 2 % 2, length, width)[:, None]
    straight = along * (gone[:, None] - half) + aside * (other + off)
    bend = along * half + aside * other + off * (np.column_stack([np.sin(course), -np.cos(course)]))
    return np.where((leg % 2 == 1)[:, None], bend, straight), course


def spikes(seed: int, share: float = LAW["spike_share"]) -> Run:
    """Independent spikes on some ranges."""
    return with_spikes(walk()[0], np.random.default_rng(seed), share)


def with_spikes(
    truth_m: Array, rng: np.random.Generator, share: float = LAW["spike_share"], anchors_m: Array = ANCHORS_M
) -> Run:
    """Ranges at places (n, 2) with independent spikes."""
    distance_m = np.linalg.norm(_at_height(truth_m)[:, None] - anchors_m, axis=2)
    law = LAW["spike_gamma"]
    hit = rng.random(distance_m.shape) < share
    late_m = hit * rng.gamma(law["shape"], law["scale_m"], distance_m.shape)
    range_m = distance_m + LAW["range_sd_m"] * rng.standard_normal(distance_m.shape) + late_m
    return Run(truth_m, range_m, np.full(range_m.shape, np.nan))


@cache
def obstacles(seed: int) -> Run:
    """Ranges through the simulator's channel."""
    return through_channel(*walk(), np.random.default_rng(seed))


def through_channel(truth_m: Array, course: Array, rng: np.random.Generator, site: Site = SITE) -> Run:
    """Ranges through the simulator's channel at places (n, 2), the person facing along `course` (n,)."""
    tag_m, anchors_m, mine = _at_height(truth_m), anchors_of(site), _mine_with_vehicle(site)
    ways = mine.look(np.repeat(tag_m, len(anchors_m), axis=0), np.tile(anchors_m, (len(tag_m), 1)))
    radios = Radios.draw(len(anchors_m), rng)
    links = FastTagLinks(INDUSTRIAL, Radios.draw(1, rng), radios, Wearer.draw(rng), rng)
    which = np.tile(np.arange(len(anchors_m)), (len(tag_m), 1))
    ranges = links.measure(tag_m, course, anchors_m[which], which, ways)
    powers = zip(ranges.first_path_power_dbm.tolist(), ranges.receive_power_dbm.tolist(), strict=True)
    told = np.array([odds_of_power_rule(los_probability_from_powers(*each)) for each in powers])
    return Run(truth_m, ranges.range_m.reshape(which.shape), told.reshape(which.shape))


def anchors_of(site: Site) -> Array:
    """Places of the anchors (n, 3)."""
    return np.array([anchor.position_m for anchor in site.anchors])


@cache
def _mine_with_vehicle(site: Site) -> Mine:
    vehicle = site.vehicles[0]
    return mine_of(site).with_obstacles([vehicle_prism(vehicle, *vehicle.position_m, vehicle.yaw_rad)])


def _at_height(truth_m: Array) -> Array:
    return np.column_stack([truth_m, np.full(len(truth_m), SITE.tag_height_m)])


class Multilateration:
    """Plain nonlinear least squares of each round, begun from the last fix, at first from the linear one."""

    def __init__(self) -> None:
        self._last: Array | None = None

    def solve(self, measurements: Measurements) -> Solution:
        """See `mine_loc_uwb.solver.Solver`."""
        linear = LeastSquares().solve(measurements)
        if self._last is None or len(measurements) < 3:
            self._last = linear.fix.position_m[:2] if linear.fix.status is FixStatus.OK else self._last
            return linear
        found = scipy_least_squares(residuals, self._last, method="lm", args=(measurements,))
        self._last = found.x
        position = np.array([*found.x, measurements.height_m])
        fix = Fix(FixStatus.OK, position, np.zeros((3, 3)), 2, len(measurements), math.nan, math.nan)
        return Solution(fix, (Reason.ACCEPTED,) * len(measurements), np.full(len(measurements), math.nan), math.nan)


def residuals(position: Array, measurements: Measurements) -> Array:
    """Distance minus range of each link."""
    offset = measurements.anchors_m - np.array([*position, measurements.height_m])
    return np.asarray(np.linalg.norm(offset, axis=1) - measurements.range_m)


def rounds_of(run: Run, sd_m: float, anchors_m: Array = ANCHORS_M) -> list[Measurements]:
    """Rounds at the paper's period, the first at 1 s."""
    height_m = SITE.tag_height_m
    return [
        measurements_of(_time_s(number), anchors_m, row, sd_m=sd_m, height_m=height_m, los_probability=told)
        for number, (row, told) in enumerate(zip(run.range_m, run.los_probability, strict=True))
    ]


def _time_s(number: int) -> float:
    return 1.0 + number * float(LAW["period_s"])


def error_cm(make: MakeSolver, scene: Scene, seed: int, sd_m: float) -> float:
    """Mean horizontal error of one run over the rounds that have a fix; fewer than 98 % is an error."""
    run = scene(seed)
    track = run_solver(make, rounds_of(run, sd_m))
    if len(track.times_s) < 0.98 * len(run.truth_m):
        raise RuntimeError(f"{len(track.times_s)} fixes of {len(run.truth_m)} rounds, seed {seed}")
    number = np.rint((track.times_s - 1.0) / LAW["period_s"]).astype(int)
    return float(100.0 * np.linalg.norm(track.positions_m - run.truth_m[number], axis=1).mean())


def seeds(name: str) -> range:
    """The seeds of a purpose."""
    first, last = LAW[name]
    return range(first, last + 1)


def best_of(makers: Mapping[str, MakeSolver], scene: Scene, sd_m: float) -> str:
    """The candidate with the least error on the tuning seeds."""
    return min(
        makers, key=lambda name: float(np.mean([error_cm(makers[name], scene, s, sd_m) for s in seeds("tuning_seeds")]))
    )


def candidates() -> dict[str, dict[str, MakeSolver]]:
    """Twenty-four settings each of the two filters."""
    lm, tracker = {}, {}
    for q, floor_m in itertools.product((0.05, 0.2, 0.8, 3.0), (0.005, 0.01, 0.02, 0.05, 0.1, 0.2)):
        lm[f"q={q} floor={floor_m}"] = _make_lm(WeightedLmSettings(q, floor_m))
    for q, share, time_s in itertools.product((0.02, 0.04, 0.1, 0.3), (0.2, 0.5, 0.95), (0.3, 1.0)):
        tracker[f"q={q} nlos_share={share} nlos_time={time_s}"] = _make_tracker(
            RobustTrackerSettings(acceleration_density_m2_s3=q, nlos_share=share, nlos_time_s=time_s)
        )
    return {"weighted_lm_kf": lm, "robust_tracker": tracker}


def _make_lm(settings: WeightedLmSettings) -> MakeSolver:
    return lambda: WeightedLmFilter(settings)


def _make_tracker(settings: RobustTrackerSettings) -> MakeSolver:
    return lambda: RobustTracker(settings)


def rows(name: str, scene: Scene) -> dict[str, Any]:
    """All solvers on the scored seeds of one scene, and their errors over plain multilateration's."""
    sd_m = GIVEN_SD_M[name]
    makers: dict[str, MakeSolver] = {"multilateration": Multilateration, "linear": LeastSquares}
    chosen = {solver: best_of(those, scene, sd_m) for solver, those in candidates().items()}
    makers |= {solver: candidates()[solver][choice] for solver, choice in chosen.items()}
    makers["robust_tracker_default"] = RobustTracker
    found = {solver: [error_cm(make, scene, seed, sd_m) for seed in seeds("seeds")] for solver, make in makers.items()}
    figures: dict[str, Any] = {f"{solver}_cm": spread(errors) for solver, errors in found.items()}
    plain = float(np.mean(found["multilateration"]))
    figures["over_multilateration"] = {solver: float(np.mean(errors)) / plain for solver, errors in found.items()}
    figures["chosen_on_tuning_seeds"] = chosen
    return figures


def cost(calls: int = 3000) -> dict[str, float]:
    """Median time of one Python call, one tag, six anchors, on the rounds of one `spikes` run."""
    rounds = rounds_of(spikes(1), LAW["range_sd_m"])
    settings = WeightedLmSettings()
    state = np.array([[place, 0.0, 0.01, 0.0, 1.0] for place in walk()[0][0]])
    step = (settings.acceleration_density_m2_s3, settings.difference_floor_m)

    def fix(each: Measurements) -> None:
        advance(state, LAW["period_s"], each.anchors_m, each.range_m, 0.0025, each.plane_m, *step)

    tracker, lm_filter = RobustTracker(), WeightedLmFilter()
    last = [walk()[0][0]]

    def scipy_fix(each: Measurements) -> None:
        last[0] = scipy_least_squares(residuals, last[0], args=(each,)).x

    return {
        "us_per_fix": _median_us(fix, rounds, calls),
        "weighted_lm_solve_us_per_fix": _median_us(lm_filter.solve, rounds, calls),
        "tracker_us_per_fix": _median_us(tracker.solve, rounds, calls),
        "scipy_us_per_fix": _median_us(scipy_fix, rounds, calls // 10),
    }


def _median_us(call: Callable[[Measurements], object], rounds: Sequence[Measurements], calls: int) -> float:
    period_ns = round(1e9 * LAW["period_s"])
    taken = []
    for number in range(calls):
        lap, place = divmod(number, len(rounds))
        each = replace(rounds[place], stamp_ns=rounds[place].stamp_ns + lap * len(rounds) * period_ns)
        began = time.perf_counter_ns()
        call(each)
        taken.append(time.perf_counter_ns() - began)
    return float(np.median(taken)) / 1e3


def fitted_share() -> float:
    """The knob: the share of spikes at which plain multilateration errs by the paper's 21.6 cm, on its own seeds."""

    def off(share: float) -> float:
        return (
            float(
                np.mean(
                    [error_cm(Multilateration, lambda s: spikes(s, share), seed, 0.05) for seed in seeds("knob_seeds")]
                )
            )
            - 21.6
        )

    low, high = 0.02, 0.10
    for _ in range(6):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if off(middle) < 0.0 else (low, middle)
    return 0.5 * (low + high)


def run() -> dict[str, Any]:
    """Figures of both scenes and of the cost."""
    return {"spikes": rows("spikes", spikes), "obstacles": rows("obstacles", obstacles), **cost()}


if __name__ == "__main__":
    print(json.dumps(run(), indent=2))
