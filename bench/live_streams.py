"""What arrives over the lines of a mine in which everybody sends everything, made before it is played.

A few people are simulated; the bytes of further ones are theirs under other tags, moved within the period of a round.
"""

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise
from pathlib import Path

import numpy as np

from mine_loc_core.people import Person, load_people
from mine_loc_core.site import Site, load_site
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S
from mine_loc_sim import scene_constants as sc
from mine_loc_sim.byte_streams import MineLocEncoder, N100Encoder
from mine_loc_sim.reports import ReportedCir, ReportedRound
from mine_loc_sim.scenario import Frame, Scenario, Timed
from mine_loc_sim.scene import SceneOptions, crew, line_of
from mine_loc_sim.walker import TrueStep

SITE = Path(__file__).parents[1] / "config" / "gallery_2km"
SIMULATED = 8
_STEP_DELAY_NS = 360 * NS_PER_MS
"""A step is known so long after its heel strike (docs/topics.md)."""

RoundKey = tuple[int, int]
"""Tag and number of a ranging round."""


@dataclass(frozen=True, slots=True)
class Write:
    """Bytes that arrive together at `at_ns` of the scene; `round` where they are a whole round with accumulators."""

    at_ns: int
    data: bytes
    round: RoundKey | None = None


@dataclass(frozen=True, slots=True)
class TimedStep:
    """A step of a person that becomes known at `at_ns` of the scene."""

    at_ns: int
    person: str
    count: int
    interval_s: float
    step: TrueStep


@dataclass(frozen=True, slots=True)
class Streams:
    """People, and what comes of them over each line (`SITE`'s receivers and `<person>/n100`) or as steps."""

    people: tuple[Person, ...]
    lines: Mapping[str, Sequence[Write]]
    steps: Sequence[TimedStep]
    seconds: float


class StreamMaker:
    """Simulates once, and makes the streams of any number of people from it."""

    def __init__(self, seconds: float, round_rate_hz: float, simulated: int = SIMULATED, seed: int = 1) -> None:
        site = load_site(SITE)
        self._site: Site = site
        self._seconds = seconds
        self._period_ns = round(NS_PER_S / round_rate_hz)
        known = tuple(load_people(SITE))
        self._models = crew(site, known, simulated)
        options = SceneOptions(seed=seed, seconds=seconds, round_rate_hz=round_rate_hz, cir=True)
        self._scenario = Scenario(site, self._models, options)
        self._rng = np.random.default_rng(seed)
        frames: dict[str, list[Timed]] = defaultdict(list)
        for block in self._scenario.blocks():
            for line, timed in block.frames.items():
                frames[line].extend(timed)
        self._rounds = {receiver.name: _rounds(frames[receiver.name]) for receiver in site.uwb_receivers}
        self._inertial = {person.name: _samples(frames[line_of(person)]) for person in self._models if person.n100}

    def streams(self, count: int, *, inertial: bool = True) -> Streams:
        """What comes of `count` people; without N100s their steps come ready-made instead."""
        people = crew(self._site, tuple(load_people(SITE)), count)
        if not inertial:
            people = tuple(replace(person, n100=None) for person in people)
        models = {person.name: self._models[number % len(self._models)] for number, person in enumerate(people)}
        copies = -(-count // len(self._models))
        lines: dict[str, Sequence[Write]] = {}
        for line, rounds in self._rounds.items():
            encode = MineLocEncoder()
            due = sorted(
                (at_ns + self._moved_ns(number, copies), number, position)
                for position, (at_ns, tag_id, _) in enumerate(rounds)
                for number, person in enumerate(people)
                if models[person.name].tag_id == tag_id
            )
            lines[line] = [_write(at_ns, rounds[at][2], people[number].tag_id, encode) for at_ns, number, at in due]
        for person in people:
            if person.n100:
                lines[line_of(person)] = self._inertial[models[person.name].name]
        return Streams(people, lines, () if inertial else self._steps(people, models), self._seconds)

    def _moved_ns(self, number: int, copies: int) -> int:
        """So much later than the rounds of the simulated person come those of person `number`."""
        return number // len(self._models) * self._period_ns // (copies * len(self._models))

    def _steps(self, people: Sequence[Person], models: Mapping[str, Person]) -> list[TimedStep]:
        timed = []
        for person in people:
            steps = self._scenario.steps(models[person.name].name)
            for count, (before, step) in enumerate(pairwise(steps), 1):
                interval_s = (step.stamp_ns - before.stamp_ns) / NS_PER_S
                timed.append(TimedStep(step.stamp_ns + _STEP_DELAY_NS, person.name, count, interval_s, step))
        return sorted((each for each in timed if each.at_ns < self._seconds * NS_PER_S), key=lambda each: each.at_ns)


def _rounds(frames: Sequence[Timed]) -> list[tuple[int, int, list[Frame]]]:
    """Arrival, tag and frames of each round: its ranges and then its accumulators, which come together."""
    rng = np.random.default_rng(0)
    found = []
    for stamp_ns, group in groupby(frames, lambda timed: timed[0]):
        together = [frame for _, frame in group]
        first = together[0]
        assert isinstance(first, ReportedRound)
        late_ns = sc.UWB_DELAY_NS + int(rng.exponential(sc.UWB_JITTER_NS))
        found.append((stamp_ns + late_ns, first.ranging.tag_id, together))
    return found


def _write(at_ns: int, frames: Sequence[Frame], tag_id: int, encode: MineLocEncoder) -> Write:
    named = [_named(frame, tag_id) for frame in frames]
    assert isinstance(named[0], ReportedRound)
    key = (tag_id, named[0].ranging.seq or 0)
    return Write(at_ns, b"".join(encode(frame) for frame in named), key)


def _named(frame: Frame, tag_id: int) -> Frame:
    if isinstance(frame, ReportedRound):
        return replace(frame, ranging=replace(frame.ranging, tag_id=tag_id))
    assert isinstance(frame, ReportedCir)
    return replace(frame, window=replace(frame.window, tag_id=tag_id))


def _samples(frames: Sequence[Timed]) -> list[Write]:
    """Sensors and attitude in pairs, as the bytes of a hundredth of a second."""
    encode = N100Encoder()
    pairs = zip(frames[::2], frames[1::2], strict=False)
    return [Write(second[0] + sc.N100_DELAY_NS, encode(first[1]) + encode(second[1])) for first, second in pairs]
