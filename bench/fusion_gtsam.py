"""The peer: GTSAM's fixed-lag smoother (iSAM2) with robust noise on the same ranges and steps.

A pose a ranging round, tied to the one before by the odometry between them (steps laid on a line of time, and known
without delay, which favours it), and to each anchor by the range, reduced to the tag's plane.
"""

import math
import time
from dataclasses import dataclass

import gtsam
import numpy as np
from fusion_runs import Run
from fusion_walks import Walk
from uwb_tracks import Array

from mine_loc_uwb.measurements import Measurements

_KERNELS = {
    "huber": gtsam.noiseModel.mEstimator.Huber.Create,
    "cauchy": gtsam.noiseModel.mEstimator.Cauchy.Create,
    "geman_mcclure": gtsam.noiseModel.mEstimator.GemanMcClure.Create,
}

_START_SDS = np.array([0.1, 0.1, math.radians(2.0)])


@dataclass(frozen=True, slots=True)
class GtsamSettings:
    """Of the smoother."""

    lag_s: float = 5.0
    kernel: str = "cauchy"
    width: float = 1.0
    range_sd_m: float = 0.15
    way_share: float = 0.1
    """Standard deviation of an odometry way over its length."""
    turn_sd_rad: float = math.radians(1.0)


def run_gtsam(walk: Walk, settings: GtsamSettings) -> Run:
    """Estimates at each round."""
    poses = _odometry(walk)
    position_m, covariance_m2 = np.empty((len(poses), 2)), np.full((len(poses), 2, 2), np.nan)
    began = time.perf_counter()
    smoother = _Smoother(walk, settings, gtsam.Pose2(*walk.start_m, poses[0].theta()))
    for number, (measurements, before, now) in enumerate(zip(walk.rounds, poses[:1] + poses, poses, strict=False)):
        position_m[number] = smoother.take(number, measurements, before.between(now))
    spent_us = 1e6 * (time.perf_counter() - began) / len(poses)
    return Run(position_m, covariance_m2, spent_us)


class _Smoother:
    """iSAM2 over the last seconds; begun anew where it was when it gives up."""

    def __init__(self, walk: Walk, settings: GtsamSettings, start: gtsam.Pose2) -> None:
        self._settings, self._at = settings, start
        self._robust = gtsam.noiseModel.Robust.Create(
            _KERNELS[settings.kernel](settings.width), gtsam.noiseModel.Isotropic.Sigma(1, settings.range_sd_m)
        )
        self._anchors_m = {
            anchor: place
            for measurements in walk.rounds
            for anchor, place in zip(measurements.anchor_ids.tolist(), measurements.anchors_m, strict=True)
        }
        self._smoother: gtsam.IncrementalFixedLagSmoother | None = None

    def take(self, number: int, measurements: Measurements, way: gtsam.Pose2) -> Array:
        """Where a round puts the person, `way` after the last one."""
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        self._at = self._at.compose(way)
        if self._smoother is None:
            self._begin(graph, values, number)
        else:
            graph.add(gtsam.BetweenFactorPose2(number - 1, number, way, _way_noise(way, self._settings)))
        values.insert(number, self._at)
        _add_ranges(graph, number, measurements, self._robust)
        try:
            self._smoother.update(graph, values, {number: measurements.stamp_ns / 1e9})
            self._at = self._smoother.calculateEstimate().atPose2(number)
        except (RuntimeError, IndexError):  # an indeterminate system, and what it leaves behind
            self._smoother = None
        return np.asarray(self._at.translation())

    def _begin(self, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, number: int) -> None:
        self._smoother = gtsam.IncrementalFixedLagSmoother(self._settings.lag_s)
        graph.add(gtsam.PriorFactorPose2(number, self._at, gtsam.noiseModel.Diagonal.Sigmas(_START_SDS)))
        exact = gtsam.noiseModel.Isotropic.Sigma(2, 1e-3)
        for anchor, place in self._anchors_m.items():
            values.insert(_anchor_key(anchor), place[:2])
            graph.add(gtsam.PriorFactorPoint2(_anchor_key(anchor), place[:2], exact))


def _way_noise(way: gtsam.Pose2, settings: GtsamSettings) -> gtsam.noiseModel.Base:
    length_m = float(np.hypot(way.x(), way.y()))
    sd_m = 0.01 + settings.way_share * math.sqrt(0.7 * length_m)  # of steps of 0.7 m that err independently
    return gtsam.noiseModel.Diagonal.Sigmas(np.array([sd_m, 0.01 + 0.5 * (sd_m - 0.01), settings.turn_sd_rad]))


def _add_ranges(
    graph: gtsam.NonlinearFactorGraph, number: int, measurements: Measurements, noise: gtsam.noiseModel.Base
) -> None:
    rows = zip(measurements.anchor_ids.tolist(), measurements.anchors_m, measurements.range_m.tolist(), strict=True)
    for anchor, anchor_m, range_m in rows:
        above_m = anchor_m[2] - (measurements.height_m or 0.0)
        plane_m = math.sqrt(max(range_m**2 - above_m**2, 0.01))
        graph.add(gtsam.RangeFactor2D(number, _anchor_key(anchor), plane_m, noise))


def _anchor_key(anchor: int) -> int:
    return int(gtsam.symbol("a", anchor))


def _odometry(walk: Walk) -> list[gtsam.Pose2]:
    """Dead-reckoned poses at the rounds, in the map by the start; between strikes on a straight line of time."""
    stamps_s = [walk.rounds[0].stamp_ns / 1e9]
    places, headings = [walk.start_m], [walk.start_yaw_rad]
    for step in walk.steps:
        heading = step.fix.heading_rad + walk.start_yaw_rad
        interval_s = step.fix.interval_s if step.fix.interval_s > 0.0 else 0.5
        if step.stamp_ns / 1e9 - interval_s > stamps_s[-1] + 0.05:  # stood until this step began
            stamps_s.append(step.stamp_ns / 1e9 - interval_s)
            places.append(places[-1])
            headings.append(headings[-1])
        stamps_s.append(step.stamp_ns / 1e9)
        places.append(places[-1] + step.fix.length_m * np.array([math.cos(heading), math.sin(heading)]))
        headings.append(heading)
    at_s = [measurements.stamp_ns / 1e9 for measurements in walk.rounds]
    track = np.array(places)
    x, y = (np.interp(at_s, stamps_s, track[:, axis]) for axis in (0, 1))
    yaw = np.interp(at_s, stamps_s, np.unwrap(headings))
    return [gtsam.Pose2(*each) for each in zip(x, y, yaw, strict=True)]
