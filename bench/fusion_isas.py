"""isas_walk_uwb_imu, Walk 1: ranges of a carried stick with truth by lighthouses; nobody's steps are counted.

    python bench/fusion_isas.py

RMSE in space after one time offset and one rigid alignment. Anchors and ranges are those of the recording, without
calibration; every method has its defaults, GTSAM (a chain of points, iSAM2 over 5 s, Cauchy) those of fusion_gtsam.py.
`mine_loc` has what dead reckoning makes of the recording's IMU (82 Hz) as well; the other rows are of ranges alone.

The recording's coordinates of anchors have z downwards, as its accelerometer says; ours upwards (REP 103).
"""

import json
from collections.abc import Iterator

import gtsam
import numpy as np
from fusion_carried import dead_reckoned
from fusion_carried import fused as carried_track
from scipy.optimize import least_squares, minimize_scalar
from scipy.spatial.transform import Rotation
from uwb_tracks import Array, measurements_of

from mine_loc_bringup.recordings.isas import Walk, read_walk
from mine_loc_bringup.recordings.public_data import data_file
from mine_loc_core.stamps import NS_PER_S
from mine_loc_pdr.dead_reckoning import ImuSample, PedestrianDeadReckoning
from mine_loc_pdr.stride import PendulumStrideModel
from mine_loc_uwb.fix import FixStatus
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.parameters import UwbSolverParameters
from mine_loc_uwb.ranging import RangingRound
from mine_loc_uwb.solvers import RANGE_SOLVERS

GIVEN_SD_M = 0.1
_HEIGHT_M = -1.2
_SEARCH_S = 1.0
_GRID_S = 0.05
_START_M = np.array([2.0, 1.0, _HEIGHT_M])
"""In the middle of the room: where iterations begin."""
_UP = np.array([1.0, -1.0, -1.0])


def rounds_of(walk: Walk) -> list[Measurements]:
    """Rounds with valid ranges."""
    rounds = [_round(at.stamp_ns / NS_PER_S, ranging, walk) for at, ranging in walk.rounds]
    return [each for each in rounds if len(each)]


def _round(time_s: float, ranging: RangingRound, walk: Walk) -> Measurements:
    ranges_m = {item.anchor_id: item.range_m for item in ranging.ranges if np.isfinite(item.range_m)}
    anchors_m = _UP * np.array([walk.anchors_m[anchor] for anchor in ranges_m]).reshape(-1, 3)
    range_m = np.array(list(ranges_m.values()), float)
    return measurements_of(time_s, anchors_m, range_m, sd_m=GIVEN_SD_M, height_m=None, ids=list(ranges_m))


def plain_least_squares(rounds: list[Measurements]) -> Iterator[tuple[float, Array]]:
    """Nonlinear, each round by itself, from the place before."""
    at = _START_M
    for each in rounds:
        if len(each) >= 3:
            at = least_squares(lambda p, m=each: np.linalg.norm(m.anchors_m - p, axis=1) - m.range_m, at).x
            yield each.stamp_ns / NS_PER_S, at


def solver(name: str, rounds: list[Measurements]) -> Iterator[tuple[float, Array]]:
    """A solver of mine_loc_uwb with its defaults."""
    solving = RANGE_SOLVERS[name](UwbSolverParameters())
    for each in rounds:
        fix = solving.solve(each).fix
        if fix.status is FixStatus.OK:
            yield each.stamp_ns / NS_PER_S, fix.position_m


def fused(rounds: list[Measurements], samples: list[ImuSample]) -> Iterator[tuple[float, Array]]:
    """The default estimator of the fusion, with what dead reckoning makes of the samples."""
    pdr = PedestrianDeadReckoning(PendulumStrideModel(1.75))
    inertial = [epoch for sample in samples for epoch in dead_reckoned(pdr, sample)]
    for stamp_ns, place_m, _ in carried_track(rounds, inertial, height_m=_HEIGHT_M):
        yield stamp_ns / NS_PER_S, place_m


def smoothed(rounds: list[Measurements]) -> Iterator[tuple[float, Array]]:
    """GTSAM; between rounds a person moves by up to half a metre a second."""
    smoother = gtsam.IncrementalFixedLagSmoother(5.0)
    cauchy = gtsam.noiseModel.mEstimator.Cauchy.Create(1.0)
    robust = gtsam.noiseModel.Robust.Create(cauchy, gtsam.noiseModel.Isotropic.Sigma(1, GIVEN_SD_M))
    exact, at, before_s = gtsam.noiseModel.Isotropic.Sigma(3, 1e-3), _START_M, 0.0
    hung: set[int] = set()
    for number, each in enumerate(rounds):
        graph, values, time_s = gtsam.NonlinearFactorGraph(), gtsam.Values(), each.stamp_ns / NS_PER_S
        if number == 0:
            graph.add(gtsam.PriorFactorPoint3(0, at, gtsam.noiseModel.Isotropic.Sigma(3, 3.0)))
        else:
            moved = gtsam.noiseModel.Isotropic.Sigma(3, 0.5 * (time_s - before_s))
            graph.add(gtsam.BetweenFactorPoint3(number - 1, number, np.zeros(3), moved))
        values.insert(number, at)
        for anchor, place, range_m in zip(each.anchor_ids.tolist(), each.anchors_m, each.range_m, strict=True):
            key = int(gtsam.symbol("a", anchor))
            if anchor not in hung:
                hung.add(anchor)
                values.insert(key, place)
                graph.add(gtsam.PriorFactorPoint3(key, place, exact))
            graph.add(gtsam.RangeFactor3(number, key, range_m, robust))
        smoother.update(graph, values, {number: time_s})
        at, before_s = np.asarray(smoother.calculateEstimate().atPoint3(number)), time_s
        yield time_s, at


def rmse_m(track: list[tuple[float, Array]], truth_s: Array, truth_m: Array) -> float:
    """Root mean square distance in space, at the best time offset and rigid alignment."""
    times_s, places_m = np.array([time_s for time_s, _ in track]), np.array([place for _, place in track])

    def left_m(offset_s: float) -> float:
        at_s = times_s + offset_s
        inside = (at_s >= truth_s[0]) & (at_s <= truth_s[-1])
        seen = np.column_stack([np.interp(at_s[inside], truth_s, truth_m[:, axis]) for axis in range(3)])
        found = places_m[inside] - places_m[inside].mean(axis=0)
        rotation, _ = Rotation.align_vectors(found, seen - seen.mean(axis=0))
        residual = found - rotation.apply(seen - seen.mean(axis=0))
        return float(np.sqrt(np.mean(np.sum(residual**2, axis=1))))

    coarse = min(np.arange(-_SEARCH_S, _SEARCH_S + _GRID_S, _GRID_S), key=left_m)
    return float(minimize_scalar(left_m, bounds=(coarse - _GRID_S, coarse + _GRID_S), method="bounded").fun)


def run() -> dict[str, float]:
    """RMSE in space [m] of each."""
    walk = read_walk(data_file("isas_walk_uwb_imu", "dataset", "ISAS-Walk1.bag"))
    rounds, samples = rounds_of(walk), [ImuSample(m.stamp_ns, m.rate_rad_s, m.force_m_s2) for _, m in walk.imu]
    tracks = {"least_squares": list(plain_least_squares(rounds)), "mine_loc": list(fused(rounds, samples))}
    tracks["mine_loc_ranges"] = list(fused(rounds, []))
    tracks |= {name: list(solver(name, rounds)) for name in RANGE_SOLVERS if name != "least_squares"}
    tracks["gtsam"] = list(smoothed(rounds))
    truth_s = np.array([stamp_ns for stamp_ns, _, _ in walk.truth]) / NS_PER_S
    truth_m = np.array([place_m for _, place_m, _ in walk.truth])
    return {name: rmse_m(track, truth_s, truth_m) for name, track in tracks.items()}


if __name__ == "__main__":
    print(json.dumps(run(), indent=2))
