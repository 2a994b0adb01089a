"""Walks of the fusion bench: what a person's devices say on a lap through a scene, and the truth.

Steps are those of the simulated N100 through dead reckoning; ranges and accumulators those of the simulator's channel,
links judged by the shipped classifier, ranges freed from their bias by received power, as in a live graph.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from uwb_tracks import Array

from mine_loc_core.site import Gallery
from mine_loc_core.stamps import NS_PER_S, to_ns
from mine_loc_core.walkable_area import WalkableArea
from mine_loc_fusion.estimate import StepFix
from mine_loc_pdr.dead_reckoning import ImuSample, PedestrianDeadReckoning
from mine_loc_pdr.fdilink import ImuFrame
from mine_loc_pdr.n100_axes import flu_from_frd
from mine_loc_pdr.stride import PendulumStrideModel
from mine_loc_sim.gait import Person, draw_person
from mine_loc_sim.imu_errors import draw_device
from mine_loc_sim.magnetic_field import GalleryField
from mine_loc_sim.mine import LinkGeometry
from mine_loc_sim.n100_device import N100Device
from mine_loc_sim.radio_constants import INDUSTRIAL
from mine_loc_sim.range_law import FastTagLinks
from mine_loc_sim.ranging_link import Radios, Ranges, TagLinks
from mine_loc_sim.route import WayPoint, plan_route
from mine_loc_sim.walker import Walker
from mine_loc_sim.wearer import Wearer
from mine_loc_uwb.cir_frames import CirFrames, concatenate
from mine_loc_uwb.link_judgement import LinkJudge, load_classifier
from mine_loc_uwb.measurements import Measurements
from mine_loc_uwb.power_bias import aps011
from mine_loc_uwb.range_correction import RangeCorrection
from mine_loc_uwb.received_power import los_probability_from_powers, odds_of_power_rule, uncompress_dbm

SCENES = Path(__file__).parent / "fusion_scenes"
_MODEL = Path(__file__).parent.parent / "src/mine_loc_uwb/mine_loc_uwb/models/los.safetensors"
_CHUNK = 16  # rounds the channel is asked for at a time
_WHITE_SD_M = 0.03
_FIRST_LEG_M = 20.0
_CALIBRATED_SD = 0.03  # one walk of a person differs from the next by so much (docs/pdr.md)
START_NS = 10 * NS_PER_S  # stamps begin well above zero


@dataclass(frozen=True, slots=True)
class ReportedStep:
    """A step, the instant of its strike and that of its report."""

    stamp_ns: int
    reported_ns: int
    fix: StepFix


@dataclass(frozen=True, slots=True)
class Walk:
    """One person's lap: truth at the rounds (n, 2), at the start, and what was measured."""

    rounds: list[Measurements]
    steps: list[ReportedStep]
    truth_m: Array
    start_m: Array
    start_yaw_rad: float
    """Of the odom frame in the map, as found on the first leg, where the course is known."""
    area: WalkableArea | None
    """Of a lap through a gallery."""


def scene(name: str) -> dict[str, Any]:
    """A committed scene."""
    content: dict[str, Any] = yaml.safe_load((SCENES / f"{name}.yaml").read_text("utf-8"))
    return content


def seeds(of: Mapping[str, Any], purpose: str) -> range:
    """The seeds of a purpose."""
    first, last = of[purpose]
    return range(first, last + 1)


def make_walk(of: Mapping[str, Any], seed: int) -> Walk:
    """Play one lap."""
    who, walking, worn, device, field, radio, detours, known = np.random.default_rng(seed).spawn(8)
    person = draw_person(who, preferred_speed_m_s=who.uniform(*of["speed_m_s"]))
    errors = draw_device(worn)
    corners = [WayPoint((*corner, 0.0)) for corner in of["corners_m"]]
    corners[0] = replace(corners[0], pause_s=of["stand_s"])
    corners[-1] = replace(corners[-1], pause_s=of["stand_s"])
    walker = _walker(person, corners, walking)
    stop_ns = START_NS + to_ns(walker.duration_s)
    steps = _steps(person, N100Device(errors, walker, GalleryField(field), device), stop_ns)
    steps = _scaled(of, steps, math.exp(of["stride_error"] * known.standard_normal()))
    stamp_ns = np.arange(START_NS, stop_ns, to_ns(of["period_s"]))
    motion = walker.motion(stamp_ns)
    tag_m = motion.position_m.copy()
    tag_m[:, 2] = of["tag_height_m"]
    blocked_m = _detours_m(of, tag_m, len(of["anchors_m"]), detours)
    rounds = rounds_of(of, stamp_ns, tag_m, motion.heading_rad, blocked_m, radio)
    return Walk(rounds, steps, tag_m[:, :2], tag_m[0, :2], _known_yaw_rad(of, walker, steps), _area(of))


def _area(of: Mapping[str, Any]) -> WalkableArea | None:
    if "gallery_width_m" not in of:
        return None
    line = tuple((float(x), float(y), 0.0) for x, y in of["corners_m"])
    return WalkableArea([Gallery("lap", line, of["gallery_width_m"], 3.0)])


def _known_yaw_rad(of: Mapping[str, Any], walker: Walker, steps: Sequence[ReportedStep]) -> float:
    """Yaw of odom on the way to the first corner, where the course is known."""
    x_m = walker.motion(np.array([step.stamp_ns for step in steps])).position_m[:, 0]
    on_first_leg = steps[: int(np.argmax(x_m > _FIRST_LEG_M))]
    first, second = of["corners_m"][:2]
    course_rad = math.atan2(second[1] - first[1], second[0] - first[0])
    off = [math.remainder(course_rad - step.fix.heading_rad, math.tau) for step in on_first_leg]
    return float(np.mean(off))


def _walker(person: Person, way_points: Sequence[WayPoint], rng: np.random.Generator) -> Walker:
    return Walker(person, plan_route(way_points, person.preferred_speed_m_s), rng, start_ns=START_NS)


def _lap_m(of: Mapping[str, Any]) -> float:
    return float(np.linalg.norm(np.diff(np.array(of["corners_m"], float), axis=0), axis=1).sum())


def _scaled(of: Mapping[str, Any], steps: Sequence[ReportedStep], scale: float) -> list[ReportedStep]:
    """Steps of a person whose K is known but for an error: their lengths add up to `scale` times the lap."""
    k = scale * _lap_m(of) / sum(step.fix.length_m for step in steps)
    return [
        replace(
            step,
            fix=replace(
                step.fix, length_m=k * step.fix.length_m, length_variance_m2=k**2 * step.fix.length_variance_m2
            ),
        )
        for step in steps
    ]


def _steps(person: Person, n100: N100Device, stop_ns: int) -> list[ReportedStep]:
    """Through dead reckoning; its x axis is where the sensor faced at the start."""
    pdr = PedestrianDeadReckoning(PendulumStrideModel(person.height_m, scale_variance=_CALIBRATED_SD**2))
    steps = []
    for stamp_ns, frame in n100.frames(stop_ns):
        if not isinstance(frame, ImuFrame):
            continue
        rate, force = flu_from_frd(frame.angular_velocity_rad_s), flu_from_frd(frame.specific_force_m_s2)
        for step in pdr.push(ImuSample(stamp_ns, rate, force)):
            interval_s = np.nan if step.interval_s is None else step.interval_s
            fix = StepFix(
                step.length_m, step.length_variance_m2, step.heading_rad, step.heading_variance_rad2, interval_s
            )
            steps.append(ReportedStep(step.stamp_ns, stamp_ns, fix))
    return steps


def rounds_of(
    of: Mapping[str, Any],
    stamp_ns: np.ndarray,
    tag_m: Array,
    facing_rad: Array,
    blocked_m: Array,
    radio: np.random.Generator,
) -> list[Measurements]:
    """Ranging rounds of a tag at places (n, 3), over excess ways (n, anchors), 0 = in sight."""
    anchors_m = np.array(of["anchors_m"], float)
    count = len(anchors_m)
    kind = TagLinks if of["judged_by"] == "classifier" else FastTagLinks
    links = kind(INDUSTRIAL, Radios.draw(1, radio), Radios.draw(count, radio), _wearer(of, radio), radio)
    found = []
    for first in range(0, len(stamp_ns), _CHUNK):
        part = slice(first, first + _CHUNK)
        which = np.tile(np.arange(count), (len(tag_m[part]), 1))
        ways = _ways(of, tag_m[part], anchors_m, blocked_m[part])
        found.append(links.measure(tag_m[part], facing_rad[part], anchors_m[which], which, ways))
    los = _judged(of, found, stamp_ns, count)
    received = np.concatenate([each.received for each in found]).reshape(-1, count)
    raw_m = np.concatenate([each.range_m for each in found]).reshape(-1, count)
    power_dbm = np.concatenate([each.receive_power_dbm for each in found]).reshape(-1, count)
    range_m = RangeCorrection(power_bias=aps011(500, 64)).correct(raw_m, power_dbm, 1.0 - los).range_m
    ids = np.arange(1, count + 1).astype(np.uint64)
    return [
        Measurements(
            int(stamp),
            ids[got],
            anchors_m[got],
            row[got],
            np.full(int(got.sum()), _WHITE_SD_M**2),
            np.zeros(int(got.sum())),
            told[got],
            uncompress_dbm(power[got], 64),
            of["tag_height_m"],
        )
        for stamp, got, row, told, power in zip(stamp_ns, received, range_m, los, power_dbm, strict=True)
    ]


def _judged(of: Mapping[str, Any], found: Sequence[Ranges], stamp_ns: np.ndarray, count: int) -> Array:
    """LOS probability (rounds, anchors) of the shipped classifier, or of what the powers are worth at even odds."""
    if of["judged_by"] == "powers":
        powers = [
            zip(each.first_path_power_dbm.tolist(), each.receive_power_dbm.tolist(), strict=True) for each in found
        ]
        told = [odds_of_power_rule(los_probability_from_powers(*link)) for each in powers for link in each]
        return np.array(told).reshape(-1, count)
    frames = concatenate([_frames(each) for each in found])
    linked = [(number, int(stamp)) for stamp in stamp_ns for number in range(count)]
    judged = LinkJudge(_classifier()).judge(frames, [link for link, _ in linked], [stamp for _, stamp in linked])
    return np.array([each.los_probability for each in judged]).reshape(-1, count)


def _wearer(of: Mapping[str, Any], rng: np.random.Generator) -> Wearer:
    """A tag on the helmet is not in the body's shadow, one at the waist is."""
    return Wearer.draw(rng) if of["tag_worn_at"] == "waist" else Wearer(0.0, 0.0)


def _detours_m(of: Mapping[str, Any], tag_m: Array, count: int, rng: np.random.Generator) -> Array:
    """Excess way (rounds, anchors) of what comes round; it rises and falls along a stretch. 0 = in sight."""
    moved_m = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tag_m[:, :2], axis=0), axis=1))])
    way_m = moved_m * _lap_m(of) / moved_m[-1]  # without the sway of the waist
    detour_m = np.zeros((len(tag_m), count))
    for stretch in of["stretches_m"]:
        along = (way_m - stretch["from"]) / (stretch["to"] - stretch["from"])
        inside = (along > 0.0) & (along < 1.0)
        largest_m = of["blocked"]["detour_m"] * rng.uniform(0.3, 1.7, len(stretch["anchors"]))
        detour_m[np.ix_(inside, stretch["anchors"])] = np.outer(np.sin(np.pi * along[inside]), largest_m)
    return detour_m


def _ways(of: Mapping[str, Any], tag_m: Array, anchors_m: Array, detour_m: Array) -> LinkGeometry:
    distance_m = np.linalg.norm(tag_m[:, None] - anchors_m, axis=2).ravel()
    detour_m = detour_m.ravel()
    blocked = detour_m > 0.0
    nothing = np.zeros(len(distance_m))
    return LinkGeometry(distance_m, nothing, of["blocked"]["loss_db"] * blocked, nothing, detour_m, blocked.astype(int))


def _frames(ranges: Ranges) -> CirFrames:
    """The accumulators as the driver hands them on."""
    assert ranges.exchanges is not None
    registers, reception = ranges.exchanges.registers, ranges.exchanges.reception
    samples = np.stack([reception.samples.real, reception.samples.imag], axis=-1)
    count = len(ranges.range_m)
    return CirFrames(
        samples=np.clip(samples, -32768, 32767).astype(np.int16),
        start_index=np.zeros(count, int),
        first_path_index=registers.first_path_index,
        symbols=registers.rxpacc.astype(float),
        noise_std=registers.noise_std.astype(float),
        receive_power_dbm=registers.receive_power_dbm,
        first_path_power_dbm=registers.first_path_power_dbm,
        range_m=ranges.range_m,
        channel=np.full(count, 2),
    )


@cache
def _classifier() -> Any:
    classifier, _ = load_classifier(_MODEL, "cpu")
    return classifier
