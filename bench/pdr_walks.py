"""Simulated walks through a marked site, and what dead reckoning reports of them sample by sample."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from gait_recordings import Array
from pdr_tracks import shipped_detector

from mine_loc_core.site import Site, load_site
from mine_loc_core.stamps import NS_PER_S, to_ns
from mine_loc_pdr.dead_reckoning import ImuSample, PedestrianDeadReckoning, StepEvent
from mine_loc_pdr.stride import PendulumStrideModel
from mine_loc_sim.gait import Person, draw_person
from mine_loc_sim.imu_errors import FLU_TO_FRD, DeviceErrors, Imu, draw_device
from mine_loc_sim.route import WayPoint, plan_route
from mine_loc_sim.walker import Walker

SCENES = Path(__file__).parent / "pdr_scenes"
RATE_HZ = 100.0
START_NS = NS_PER_S
Way = Sequence[Sequence[float]]


@dataclass(frozen=True, slots=True)
class Scene:
    """A site and the walks through it (walks.yaml)."""

    site: Site
    walks: dict[str, Any]

    @classmethod
    def read(cls, name: str) -> "Scene":
        """The scene of a folder under pdr_scenes/."""
        folder = SCENES / name
        return cls(load_site(folder), yaml.safe_load((folder / "walks.yaml").read_text("utf-8")))


@dataclass(frozen=True, slots=True)
class Report:
    """What came of one sample: its stamp, where the waist faced in odom, the steps that were completed with it."""

    stamp_ns: int
    heading_rad: float
    steps: Sequence[StepEvent]


@dataclass(frozen=True, slots=True)
class Walk:
    """One person's walk: what dead reckoning reported, in order, what is told of the start, and the truth."""

    reports: list[Report]
    start_m: tuple[float, float]
    start_yaw_rad: float
    bias_sd_rad_s: float  # claimed at the first step
    walker: Walker

    def truth_m(self, stamps_ns: Sequence[int]) -> Array:
        """Where the waist was, (n, 2)."""
        return self.walker.motion(np.array(stamps_ns)).position_m[:, :2]


class Crew:
    """The people of a scene in one seed, each with an N100 and a scale k from a walk of known length."""

    def __init__(self, scene: Scene, seed: int) -> None:
        self._walks = scene.walks
        self._seed = seed
        rngs = [self._rng(number, 0) for number in range(len(self._walks["people"]))]
        self._people = [
            draw_person(rng, height_m=each["height_m"], preferred_speed_m_s=each["speed_m_s"])
            for rng, each in zip(rngs, self._walks["people"], strict=True)
        ]
        self._devices = [draw_device(rng) for rng in rngs]
        self._calibration = [self._calibrate(number) for number in range(len(self._people))]
        self._stride_z = [float(rng.standard_normal()) for rng in rngs]

    def walk(self, way_name: str, stride_error_sd: float | None = None) -> list[Walk]:
        """Everybody walks a way of the scene; `stride_error_sd` in place of the scene's."""
        sd = self._walks["stride_error_sd"] if stride_error_sd is None else stride_error_sd
        return [
            self._walk(number, way_name, self._calibration[number] * (1.0 + sd * z))
            for number, z in enumerate(self._stride_z)
        ]

    def _rng(self, number: int, purpose: int) -> np.random.Generator:
        return np.random.default_rng([self._seed, number, purpose])

    def _calibrate(self, number: int) -> float:
        """K from a straight walk of known length, as `mine-loc calibrate-stride` finds it."""
        length_m = self._walks["calibration_m"]
        walker = _walker(
            self._people[number], [[0, 0], [length_m, 0]], 0.0, self._walks["standing_s"], self._rng(number, 1)
        )
        reports = _dead_reckoning(self._people[number], self._devices[number], walker, 1.0, self._rng(number, 2))[0]
        return length_m / sum(step.length_m for report in reports for step in report.steps)

    def _walk(self, number: int, way_name: str, scale: float) -> Walk:
        person, way = self._people[number], self._walks[way_name]
        rng = self._rng(number, 3 if way_name == "turn_way_m" else 4)
        walker = _walker(person, way, self._walks["way_point_sd_m"], self._walks["standing_s"], rng)
        reports, bias_sd = _dead_reckoning(person, self._devices[number], walker, scale, rng)
        (x0, y0), (x1, y1) = way[:2]
        return Walk(reports, (x0, y0), math.atan2(y1 - y0, x1 - x0), bias_sd, walker)


def _walker(person: Person, way: Way, way_point_sd_m: float, standing_s: float, rng: np.random.Generator) -> Walker:
    """A person who turns beside the way-points and stands at both ends."""
    points = np.array(way, dtype=float)
    points[1:] += way_point_sd_m * np.clip(rng.standard_normal(points[1:].shape), -2.5, 2.5)
    ends = (0, len(points) - 1)
    way_points = [
        WayPoint((x, y, 0.0), pause_s=standing_s if number in ends else 0.0)
        for number, (x, y) in enumerate(points.tolist())
    ]
    return Walker(person, plan_route(way_points, person.preferred_speed_m_s), rng, START_NS)


def _dead_reckoning(
    person: Person, device: DeviceErrors, walker: Walker, scale: float, rng: np.random.Generator
) -> tuple[list[Report], float]:
    """Push every sample of a walk, as the node does; also the gyro bias' standard deviation at the first step."""
    imu = Imu(device, RATE_HZ, rng)
    stamps_ns = imu.stamps_ns(START_NS, START_NS + to_ns(walker.duration_s))
    sensed = imu.sample(walker.motion(stamps_ns), np.zeros((len(stamps_ns), 3)))
    rates, forces = (values.astype(float) * FLU_TO_FRD for values in (sensed.gyro_rad_s, sensed.accel_m_s2))
    pdr = PedestrianDeadReckoning(PendulumStrideModel(person.height_m, scale), detector=shipped_detector())
    reports, bias_sd = [], 0.0
    for stamp_ns, rate, force in zip(stamps_ns.tolist(), rates.tolist(), forces.tolist(), strict=True):
        steps = pdr.push(ImuSample(stamp_ns, tuple(rate), tuple(force)))
        if pdr.step_count == 0:
            bias_sd = pdr.bias_sd_rad_s
        if pdr.heading_rad is not None:
            reports.append(Report(stamp_ns, pdr.heading_rad, steps))
    return reports, bias_sd
