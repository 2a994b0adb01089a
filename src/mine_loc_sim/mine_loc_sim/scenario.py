"""A scene played: what every device of a site measures, block by block, with the truth it measured.

Everything follows from site, people and options: same arguments, same frames. Time 0 is the beginning of the scene.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_core.people import Person
from mine_loc_core.site import Site
from mine_loc_core.stamps import NS_PER_S, to_ns
from mine_loc_pdr.fdilink import AhrsFrame, ImuFrame
from mine_loc_sim import scene_constants as sc
from mine_loc_sim.bearing_emulator import BearingEmulator, Track, TrueBearing
from mine_loc_sim.gait import draw_person
from mine_loc_sim.imu_errors import draw_device
from mine_loc_sim.magnetic_field import GalleryField
from mine_loc_sim.mine import Mine
from mine_loc_sim.n100_device import N100Device, mounted
from mine_loc_sim.ranging_link import Radios
from mine_loc_sim.reports import Report, Reporters
from mine_loc_sim.route import plan_route
from mine_loc_sim.route_network import RouteNetwork
from mine_loc_sim.scene import SceneOptions, anchor_places_m, check_formats, line_names, line_of, monitor_line
from mine_loc_sim.site_mine import mine_of, vehicle_prism
from mine_loc_sim.tag_radio import HeardRound, RoundPlan, TagRadio, shortest_ways
from mine_loc_sim.walker import TrueStep, TrueTurn, Walker

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
_CROWD_STEP_NS = NS_PER_S // 10
Frame = Report | ImuFrame | AhrsFrame | BearingReport
Timed = tuple[int, Frame]


@dataclass(frozen=True, slots=True)
class TrueLink:
    """Truth of one exchange: link class as in mine_loc_interfaces/LinkState, and the error of the reported range."""

    stamp_ns: int
    person: str
    anchor_id: int
    link_class: int
    distance_m: float
    error_m: float


@dataclass(frozen=True, slots=True)
class TruePose:
    """Poses of one person at n instants: position of the tag (n, 3), course, attitude of the waist, velocity (n, 3)."""

    stamp_ns: Stamps
    position_m: Array
    heading_rad: Array
    orientation_wxyz: Array
    velocity_m_s: Array


@dataclass(frozen=True, slots=True)
class Block:
    """A stretch of a scene: frames of each line with the instants of their measurements, in order, and the truth.

    A monitor's reports stand at the instants of their sending, and are of this block or an earlier one.
    """

    start_ns: int
    stop_ns: int
    frames: Mapping[str, Collection[Timed]]
    links: Sequence[TrueLink]
    bearings: Sequence[TrueBearing]


class _Body:
    """One person of a scene with what they wear."""

    def __init__(
        self, person: Person, walker: Walker, tag_height_m: float, n100: N100Device | None, tag: TagRadio | None
    ) -> None:
        self.person, self.walker, self.n100, self.tag = person, walker, n100, tag
        self._above_waist_m = tag_height_m - walker.person.waist_height_m

    def pose(self, stamp_ns: Stamps) -> TruePose:
        """Truth at stamps (n,): the tag moves with the waist, at its own height."""
        motion = self.walker.motion(stamp_ns)
        position = motion.position_m + np.array([0.0, 0.0, self._above_waist_m])
        return TruePose(stamp_ns, position, motion.heading_rad, motion.orientation_wxyz, motion.velocity_m_s)


class Scenario:
    """A scene ready to be played once. Raises ConfigurationError for what cannot be simulated."""

    def __init__(self, site: Site, people: Sequence[Person], options: SceneOptions) -> None:
        check_formats(site)
        self.site, self.people, self.options = site, tuple(people), options
        self.lines = line_names(site, people)
        seeds = np.random.SeedSequence(options.seed).spawn(4 + len(people))
        self._mine = _with_vehicles(site)
        self._anchors_m = anchor_places_m(site)
        self._field = GalleryField(np.random.default_rng(seeds[0]))
        self._radios = Radios.draw(len(self._anchors_m), np.random.default_rng(seeds[1]))
        self._reporters = Reporters(site, people, self._anchors_m, np.random.default_rng(seeds[2]), options)
        network = RouteNetwork(site, self._mine.obstacle_parts)
        rngs = [np.random.default_rng(seed) for seed in seeds[3:-1]]
        self._bodies = {person.name: self._body(person, network, rng) for person, rng in zip(people, rngs, strict=True)}
        self._bearings = self._monitors(np.random.default_rng(seeds[-1]))

    def _monitors(self, rng: np.random.Generator) -> BearingEmulator:
        """Everybody carries an emitter."""
        tracks = {name: _track(body) for name, body in self._bodies.items()}
        return BearingEmulator(self.site.monitors, tracks, self.options.monitor_errors, rng)

    def _body(self, person: Person, network: RouteNetwork, rng: np.random.Generator) -> _Body:
        ways, walking, device, imu, tag = rng.spawn(5)
        gait = draw_person(walking, height_m=person.height_m)
        length_m = self.options.seconds * 1.2 * gait.preferred_speed_m_s
        way_points = self.options.routes.get(person.name) or network.walk(ways, length_m)
        walker = Walker(gait, plan_route(way_points, gait.preferred_speed_m_s), walking)
        height_m = self.site.tag_height_m if person.tag_height_m is None else person.tag_height_m
        n100 = None
        if person.n100:
            errors = mounted(draw_device(device), person.n100.mounting_rpy_rad)
            n100 = N100Device(errors, walker, self._field, imu)
        environment, cir = self.options.environment, self.options.cir
        radio = None
        if person.tag_id and len(self._anchors_m):
            radio = TagRadio(environment, self._radios, tag, cir=cir)
        return _Body(person, walker, height_m, n100, radio)

    def pose(self, person: str, stamp_ns: Stamps) -> TruePose:
        """Truth of one person at stamps (n,), at any time and in any order."""
        return self._bodies[person].pose(stamp_ns)

    def steps(self, person: str) -> tuple[TrueStep, ...]:
        """All true steps of a person."""
        return self._bodies[person].walker.steps()

    def turns(self, person: str) -> tuple[TrueTurn, ...]:
        """All true turns of a person."""
        return self._bodies[person].walker.turns()

    def blocks(self) -> Iterator[Block]:
        """Play the scene, once; a block is made when it is asked for."""
        share_ns = sc.PERSON_NS_A_BLOCK // max(len(self.people), 1)
        length_ns = min(max(share_ns, sc.SHORTEST_BLOCK_NS), sc.LONGEST_BLOCK_NS)
        length_ns = sc.BLOCK_WITH_CIR_NS if self.options.cir else length_ns
        stop_ns = to_ns(self.options.seconds)
        for start_ns in range(0, stop_ns, length_ns):
            yield self._block(start_ns, min(start_ns + length_ns, stop_ns))

    def _block(self, start_ns: int, stop_ns: int) -> Block:
        worn = {line_of(body.person): body.n100 for body in self._bodies.values() if body.n100 is not None}
        inertial = {line: n100.frames(stop_ns) for line, n100 in worn.items()}
        frames: dict[str, list[Timed]] = {line: [] for line in self.lines if line not in worn}
        links: list[TrueLink] = []
        for person, heard in self._rounds(start_ns, stop_ns):
            links += _truth_of(person, heard, self.site)
            for line, frame in self._reporters.report(person, heard):
                frames[line].append((heard.stamp_ns, frame))
        sent, bearings = self._bearings.play(stop_ns)
        for monitor in self.site.monitors:
            frames[monitor_line(monitor)] += sent[monitor.id]
        return Block(start_ns, stop_ns, {**frames, **inertial}, links, bearings)

    def _rounds(self, start_ns: int, stop_ns: int) -> list[tuple[Person, HeardRound]]:
        """All rounds of the block, in order of time. Tags have their turns one after the other within a period."""
        tagged = [body for body in self._bodies.values() if body.tag is not None]
        stamps = [self._round_stamps(slot / len(tagged), start_ns, stop_ns) for slot in range(len(tagged))]
        crowd = _Crowd(tagged, start_ns, stop_ns)
        heard: list[tuple[Person, HeardRound]] = []
        for number, (body, stamp_ns) in enumerate(zip(tagged, stamps, strict=True)):
            if body.tag is not None and len(stamp_ns):
                plan = self._plan(body.pose(stamp_ns), crowd.others_m(number, stamp_ns))
                heard += [(body.person, each) for each in body.tag.measure(plan)]
        return sorted(heard, key=lambda item: item[1].stamp_ns)

    def _round_stamps(self, phase: float, start_ns: int, stop_ns: int) -> Stamps:
        period_ns = NS_PER_S / self.options.round_rate_hz
        first, last = (int(np.ceil(bound / period_ns - phase)) for bound in (start_ns, stop_ns))
        stamps: Stamps = np.rint((np.arange(first, last) + phase) * period_ns).astype(np.int64)
        return stamps

    def _plan(self, pose: TruePose, others_m: Array | None) -> RoundPlan:
        """Choose anchors every few rounds: of the nearest, those with the shortest ways."""
        rounds = len(pose.stamp_ns)
        asked = np.arange(0, rounds, sc.DISCOVERY_ROUNDS)
        distance_m = np.linalg.norm(pose.position_m[asked, None] - self._anchors_m, axis=2)
        near = np.argsort(distance_m, axis=1, kind="stable")[:, : sc.CANDIDATES]
        found = self._mine.look(*self._links(pose, asked, near))
        chosen, answers = shortest_ways(found, near, sc.ANCHORS_A_ROUND)
        every = np.arange(rounds)
        latest = every // sc.DISCOVERY_ROUNDS
        which = chosen[latest]
        links = self._links(pose, every, which)
        people_m = None if others_m is None else np.repeat(others_m, which.shape[1], axis=0)
        ways = self._mine.look(*links, people_m)
        anchor_m = links[1].reshape(*which.shape, 3)
        return RoundPlan(pose.stamp_ns, pose.position_m, pose.heading_rad, which, anchor_m, answers[latest], ways)

    def _links(self, pose: TruePose, rounds: NDArray[np.int64], which: NDArray[np.int64]) -> tuple[Array, Array]:
        """Both ends (r x k, 3) of the links of some rounds (r,) to anchors `which` (r, k)."""
        tag_m = np.repeat(pose.position_m[rounds], which.shape[1], axis=0)
        return tag_m, self._places_m(pose.stamp_ns[rounds], which).reshape(-1, 3)

    def _places_m(self, stamp_ns: Stamps, which: NDArray[np.int64]) -> Array:
        """Where anchors `which` (r, k) truly hang at stamps (r,), as (r, k, 3)."""
        places = self._anchors_m[which]
        for away in self.options.moved_anchors:
            number = next(i for i, anchor in enumerate(self.site.anchors) if anchor.id == away.anchor_id)
            during = (stamp_ns >= away.start_ns) & (stamp_ns < away.stop_ns)
            places = places + ((which == number) & during[:, None])[..., None] * np.array(away.shift_m)
        return np.asarray(places)


class _Crowd:
    """Where everybody is in plan during a block, every tenth of a second and straight between."""

    def __init__(self, bodies: Sequence[_Body], start_ns: int, stop_ns: int) -> None:
        self._stamp_ns = np.arange(start_ns, stop_ns + 2 * _CROWD_STEP_NS, _CROWD_STEP_NS)
        self._places_m = [body.pose(self._stamp_ns).position_m[:, :2] for body in bodies] if len(bodies) > 1 else []

    def others_m(self, number: int, stamp_ns: Stamps) -> Array | None:
        """Places (n, others, 2) of all but one; None if there is nobody else."""
        others = [places for i, places in enumerate(self._places_m) if i != number]
        if not others:
            return None
        columns = [np.interp(stamp_ns, self._stamp_ns, places[:, axis]) for places in others for axis in (0, 1)]
        return np.stack(columns, axis=1).reshape(len(stamp_ns), -1, 2)


def _track(body: _Body) -> Track:
    return lambda stamp_ns: body.pose(stamp_ns).position_m


def _with_vehicles(site: Site) -> Mine:
    bodies = [vehicle_prism(v, *v.position_m, v.yaw_rad) for v in site.vehicles]
    return mine_of(site).with_obstacles(bodies)


def _truth_of(person: Person, heard: HeardRound, site: Site) -> list[TrueLink]:
    rows = zip(
        heard.which.tolist(), heard.link_class.tolist(), heard.distance_m.tolist(), heard.range_m.tolist(), strict=True
    )
    return [
        TrueLink(heard.stamp_ns, person.name, site.anchors[number].id, link_class, distance_m, range_m - distance_m)
        for number, link_class, distance_m, range_m in rows
    ]
