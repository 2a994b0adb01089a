"""Outputs, truth, verdicts and steps from a bag, by the names of `docs/topics.md`."""

import functools
from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mine_loc_bringup.bag_messages import BagMessages, open_bag
from mine_loc_bringup.evaluation.track import Array, Integers, StepCount, Track, Truth
from mine_loc_bringup.message_types import workspace_types
from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_MS, to_stamp_ns
from mine_loc_core.verdicts import Reason, Source

POSES = "/fused/poses"
TRUTH = "truth/<person>/pose"
PLACEHOLDER = "<person>"
_VERDICTS = {"/fused/verdicts": "fused", "/uwb/verdicts": "uwb"}
_DIAGNOSTICS = "/diagnostics"
_STEPS, _TRUE_STEPS = "/pdr/steps", "/truth/steps"
_MEASURED = {"/uwb/ranges", "/uwb/tdoa", "/uwb/pose", "/sync/epochs", _STEPS}
_MEASURED_OF_PERSON = ("/imu/data", "/odometry")
"""What comes when something was measured; other topics beat time without it."""
_TYPES = {
    POSES: "mine_loc_interfaces/msg/PersonPoseArray",
    _DIAGNOSTICS: "diagnostic_msgs/msg/DiagnosticArray",
    **dict.fromkeys(_VERDICTS, "mine_loc_interfaces/msg/MeasurementVerdictArray"),
    **dict.fromkeys((_STEPS, _TRUE_STEPS), "mine_loc_interfaces/msg/Step"),
}
_EARLY_NS = 300 * NS_PER_MS  # a heel strike is found a little before or after it was marked
Progress = Callable[[float], None]


@dataclass(slots=True)
class _Columns:
    """A person's outputs as they are read: rows of stamp, logged, mode and of x, y, three covariances, circle."""

    integers: array = field(default_factory=lambda: array("q"))  # type: ignore[type-arg]
    numbers: array = field(default_factory=lambda: array("d"))  # type: ignore[type-arg]

    def track(self) -> Track:
        stamp_ns, logged_ns, modes = np.array(self.integers, np.int64).reshape(-1, 3).T
        x, y, xx, xy, yy, ce95_m = np.array(self.numbers, np.float64).reshape(-1, 6).T
        covariance_m2 = np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2)
        return Track(stamp_ns, logged_ns, np.column_stack([x, y]), covariance_m2, ce95_m, modes)


@dataclass(slots=True)
class Outputs:
    """What a bag holds of the graph's outputs. `span_ns`: from the first measurement to what came last."""

    tracks: dict[str, Track] = field(default_factory=dict)
    frame: str = ""
    verdicts: dict[str, dict[str, Counter[str]]] = field(default_factory=dict)
    """Topic (fused, uwb) → source → reason → how many."""
    counters: dict[str, dict[str, float]] = field(default_factory=dict)
    """Diagnostic (as `synchroniser: inputs`) → key → the last number told."""
    found_steps: dict[str, Integers] = field(default_factory=dict)
    true_steps: dict[str, Integers] = field(default_factory=dict)
    span_ns: tuple[int, int] = (0, 0)

    def steps(self, person: str) -> StepCount | None:
        """Counted over the time in which strikes are marked; None where none are, or the bag has no steps at all."""
        true = self.true_steps.get(person)
        if true is None or not self.found_steps:
            return None
        found = self.found_steps.get(person, np.empty(0, np.int64))
        inside = (found >= true.min() - _EARLY_NS) & (found <= true.max() + _EARLY_NS)
        return StepCount(len(true), int(inside.sum()))


def read_outputs(bag: Path, progress: Progress | None = None) -> Outputs:
    """Read a bag. Raises ConfigurationError for one that cannot be read, or has neither poses nor steps to evaluate."""
    outputs = Outputs()
    columns: dict[str, _Columns] = {}
    steps: dict[str, dict[str, list[int]]] = {_STEPS: {}, _TRUE_STEPS: {}}
    first_ns, last_ns = 2**62, 0
    with open_bag(bag) as messages:
        _check_topics(bag, messages.topics)
        for topic, logged_ns, read in _messages(messages, set(messages.topics), progress):
            if topic in _MEASURED or topic.endswith(_MEASURED_OF_PERSON):
                first_ns = min(first_ns, logged_ns)
            if not topic.startswith("/truth/"):
                last_ns = max(last_ns, logged_ns)
            if topic == POSES:
                _take_poses(read(), logged_ns, columns, outputs)
            elif topic in _VERDICTS:
                _take_verdicts(read(), outputs.verdicts.setdefault(_VERDICTS[topic], {}))
            elif topic == _DIAGNOSTICS:
                _take_counters(read(), outputs.counters)
            elif topic in steps:
                message = read()
                steps[topic].setdefault(message.person, []).append(to_stamp_ns(message.header.stamp))
    outputs.tracks = {name: each.track() for name, each in sorted(columns.items())}
    outputs.found_steps, outputs.true_steps = (
        {name: np.unique(np.array(stamps, np.int64)) for name, stamps in found.items()} for found in steps.values()
    )
    first_ns = min(first_ns, *(int(track.logged_ns[0]) for track in outputs.tracks.values()), last_ns)
    outputs.span_ns = (first_ns, last_ns)
    return outputs


def read_truth(bag: Path, pattern: str, people: list[str], progress: Progress | None = None) -> dict[str, Truth]:
    """Tracks of truth by person: from topics that fit `pattern`, or from one topic for the only person.

    Poses, transforms and points of any type that has a header are read. Raises ConfigurationError for a bag or topic
    that cannot be read, and for one topic without a placeholder where there are several people.
    """
    rows: dict[str, list[tuple[int, float, float]]] = {}
    frames: dict[str, str] = {}
    with open_bag(bag) as messages:
        person_of = _people_of(pattern, sorted(messages.topics), people)
        for topic, _, read in _messages(messages, set(person_of), progress):
            message = read()
            stamp_ns, place = to_stamp_ns(message.header.stamp), _place(message, f"{bag}: {topic}")
            rows.setdefault(person_of[topic], []).append((stamp_ns, float(place.x), float(place.y)))
            frames.setdefault(person_of[topic], str(message.header.frame_id))
    return {name: _truth(found, frames[name]) for name, found in sorted(rows.items())}


def _check_topics(bag: Path, types: Mapping[str, str]) -> None:
    if POSES not in types and not {_STEPS, _TRUE_STEPS} <= set(types):
        raise ConfigurationError(
            f"{bag}: no topic {POSES}; allowed: a bag with {POSES}, or with {_STEPS} and {_TRUE_STEPS}"
        )
    for topic, expected in _TYPES.items():
        if types.get(topic, expected) != expected:
            raise ConfigurationError(f"{bag}: {topic} is of type {types[topic]}; allowed: {expected}")


def _people_of(pattern: str, topics: list[str], people: list[str]) -> dict[str, str]:
    """The person of each topic of truth."""
    wanted = "/" + pattern.removeprefix("/")
    before, placeholder, after = wanted.partition(PLACEHOLDER)
    if not placeholder:
        if wanted not in topics:
            raise ConfigurationError(f"--truth: no topic {wanted}; allowed: one of {', '.join(topics)}")
        if len(people) != 1:
            raise ConfigurationError(f"--truth: {wanted} is one topic for {len(people)} people; allowed: {PLACEHOLDER}")
        return {wanted: people[0]}
    names = {topic: topic[len(before) : len(topic) - len(after)] for topic in topics if _fits(topic, before, after)}
    return {topic: name for topic, name in names.items() if name and "/" not in name}


def _fits(topic: str, before: str, after: str) -> bool:
    return topic.startswith(before) and topic.endswith(after) and len(topic) > len(before) + len(after)


def _place(message: Any, where: str) -> Any:
    """The place in a PoseStamped, PoseWithCovarianceStamped, Odometry, TransformStamped or PointStamped."""
    for path in (("pose", "pose", "position"), ("pose", "position"), ("transform", "translation"), ("point",)):
        found = message
        for name in path:
            found = getattr(found, name, None)
        if found is not None:
            return found
    raise ConfigurationError(f"{where} has no place; allowed: a stamped pose, odometry, transform or point")


def _truth(rows: list[tuple[int, float, float]], frame: str) -> Truth:
    stamp_ns, rising = np.unique(np.array([row[0] for row in rows], np.int64), return_index=True)
    position_m: Array = np.array([row[1:] for row in rows], np.float64).reshape(-1, 2)[rising]
    known = np.isfinite(position_m).all(axis=1)
    return Truth(stamp_ns[known], position_m[known], frame)


def _take_poses(message: Any, logged_ns: int, columns: dict[str, _Columns], outputs: Outputs) -> None:
    outputs.frame = outputs.frame or str(message.header.frame_id)
    for person in message.people:
        own = columns.setdefault(person.person, _Columns())
        own.integers.extend((to_stamp_ns(person.stamp), logged_ns, person.mode))
        place, covariance = person.pose.pose.position, person.pose.covariance
        own.numbers.extend((place.x, place.y, covariance[0], covariance[1], covariance[7], person.horizontal_ce95))


def _take_verdicts(message: Any, counts: dict[str, Counter[str]]) -> None:
    for verdict in message.verdicts:
        source = _name(Source, verdict.source)
        counts.setdefault(source, Counter())[_name(Reason, verdict.reason)] += 1


def _take_counters(message: Any, counters: dict[str, dict[str, float]]) -> None:
    for status in message.status:
        own = counters.setdefault(status.name, {})
        for item in status.values:
            with suppress(ValueError):
                own[item.key] = float(item.value)


def _name(kind: type[Source] | type[Reason], number: int) -> str:
    return kind(number).name if number in kind.__members__.values() else "UNKNOWN"


def _messages(
    messages: BagMessages, wanted: set[str], progress: Progress | None
) -> Iterator[tuple[str, int, Callable[[], Any]]]:
    """Topic, log time and a way to read each message; `progress` hears which share of the bag is done."""
    types = workspace_types()
    for number, each in enumerate(messages.read(wanted)):
        if progress and number % 500 == 0:
            progress((each.log_ns - messages.start_ns) / max(messages.end_ns - messages.start_ns, 1))
        yield each.topic, each.log_ns, functools.partial(types.deserialize_cdr, each.data, each.type_name)
