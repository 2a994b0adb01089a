"""Time alignment: inputs of many sources become epochs of one person, in order, each input used exactly once.

A ranging round opens an epoch, which goes out as soon as its companions are there (its link states or, where nobody
judges links, the position solved from it) or a few milliseconds have passed. What is late by nature (steps) is not
waited for: it follows in an epoch marked late, and the fusion corrects with it.
"""

from collections import Counter, OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from mine_loc_core.stamps import NS_PER_S
from mine_loc_core.verdicts import Reason

_REMEMBERED_INPUTS = 4096  # four seconds of 64 links at 15 Hz
_REMEMBERED_SOURCES = 256
_LINK_STATES_EXPECTED_NS = 2 * NS_PER_S


class Kind(Enum):
    """Kinds of input; the values are the fields of mine_loc_interfaces/Epoch."""

    RANGES = "ranges"
    TDOA = "tdoa"
    UWB_POSE = "uwb_poses"
    LINK_STATE = "link_states"
    STEP = "steps"
    LANDMARK = "landmark_fixes"
    VELOCITY_CHANGE = "velocity_changes"


CAPACITY = {
    Kind.RANGES: 8,
    Kind.TDOA: 8,
    Kind.UWB_POSE: 8,
    Kind.LINK_STATE: 64,
    Kind.STEP: 16,
    Kind.LANDMARK: 4,
    Kind.VELOCITY_CHANGE: 16,
}
"""Bounds of the sequences in mine_loc_interfaces/Epoch."""

_COMPANIONS = (Kind.UWB_POSE, Kind.LINK_STATE)
_WAITING = (Kind.RANGES, *_COMPANIONS, Kind.VELOCITY_CHANGE)
"""A change of velocity is told at once: it waits too, lest it takes a round along that still does."""


@dataclass(frozen=True, slots=True)
class SyncInput:
    """One input: `source` and `seq` identify it.

    `links` is the number of link states a round may get; `size` is how much of the capacity of its kind it takes.
    """

    person: str
    kind: Kind
    source: Hashable
    seq: int
    stamp_ns: int
    payload: Any
    links: int = 0
    size: int = 1


@dataclass(frozen=True, slots=True)
class Epoch:
    """All that belongs to one instant of one person."""

    person: str
    seq: int
    stamp_ns: int
    late: bool
    inputs: dict[Kind, list[Any]]


@dataclass(slots=True)
class _Open:
    stamp_ns: int
    deadline_ns: int
    links: int
    inputs: dict[Kind, list[Any]] = field(default_factory=dict)
    sizes: Counter[Kind] = field(default_factory=Counter)


@dataclass(slots=True)
class _Person:
    open: dict[int, _Open] = field(default_factory=dict)
    last_stamp_ns: int | None = None
    seq: int = 0
    seen: OrderedDict[tuple[Kind, Hashable, int, int], None] = field(default_factory=OrderedDict)
    forgotten_ns: int | None = None
    """Newest stamp among the inputs no longer remembered: whether an older one is a duplicate cannot be told."""
    newest_of_source: OrderedDict[Hashable, int] = field(default_factory=OrderedDict)
    link_state_heard_ns: int | None = None


class Synchroniser:
    """The reorder buffer of all people. Times are ROS time in ns; `now_ns` is given, so it is deterministic."""

    def __init__(self, *, companion_wait_ns: int, history_ns: int, future_ns: int, max_open: int) -> None:
        self._companion_wait_ns = companion_wait_ns
        self._history_ns = history_ns
        self._future_ns = future_ns
        self._max_open = max_open
        self._people: dict[str, _Person] = {}
        self._waiting: dict[str, None] = {}  # whose epochs are open, in order of opening
        self.used = 0
        self.refused: Counter[Reason] = Counter()
        self.late = 0

    @property
    def next_deadline_ns(self) -> int | None:
        """When the next open epoch has waited long enough; None while none is open."""
        open_epochs = (epoch for name in self._waiting for epoch in self._people[name].open.values())
        return min((epoch.deadline_ns for epoch in open_epochs), default=None)

    def push(self, item: SyncInput, now_ns: int) -> tuple[list[Epoch], Reason]:
        """Take an input; the epochs that are complete now, and whether the input was taken (ACCEPTED) or why not."""
        person = self._people.setdefault(item.person, _Person())
        reason = self._judge(person, item, now_ns)
        if reason is not Reason.ACCEPTED:
            self.refused[reason] += 1
            return self.poll(now_ns), reason
        self.used += 1
        if item.kind is Kind.LINK_STATE:
            person.link_state_heard_ns = now_ns
        epoch = person.open.get(item.stamp_ns)
        if epoch is None:
            wait_ns = self._companion_wait_ns if item.kind in _WAITING else 0
            epoch = person.open[item.stamp_ns] = _Open(item.stamp_ns, now_ns + wait_ns, item.links)
            self._waiting[item.person] = None
        epoch.links = max(epoch.links, item.links)
        epoch.inputs.setdefault(item.kind, []).append(item.payload)
        epoch.sizes[item.kind] += item.size
        return self._emit(item.person, person, now_ns), reason

    def poll(self, now_ns: int) -> list[Epoch]:
        """The epochs whose time to wait is over."""
        return [epoch for name in list(self._waiting) for epoch in self._emit(name, self._people[name], now_ns)]

    def reset(self) -> None:
        """Time jumped: forget all stamps. What was open is lost and counted as overflow."""
        for person in self._people.values():
            self._count_lost(person)
        self._people = {name: _Person(seq=person.seq) for name, person in self._people.items()}
        self._waiting.clear()

    def forget(self, person: str) -> None:
        """Release a person who is no longer in the people file."""
        gone = self._people.pop(person, None)
        self._waiting.pop(person, None)
        if gone is not None:
            self._count_lost(gone)

    def _count_lost(self, person: _Person) -> None:
        lost = sum(len(payloads) for epoch in person.open.values() for payloads in epoch.inputs.values())
        if lost:
            self.used -= lost
            self.refused[Reason.OVERFLOW] += lost

    def _judge(self, person: _Person, item: SyncInput, now_ns: int) -> Reason:
        if item.stamp_ns > now_ns + self._future_ns:
            return Reason.FUTURE
        identity = (item.kind, item.source, item.seq, item.stamp_ns)
        if identity in person.seen:
            return Reason.DUPLICATE
        newest_ns = person.newest_of_source.get((item.kind, item.source))
        if newest_ns is not None and item.stamp_ns < newest_ns:
            return Reason.BACKWARD
        forgotten = person.forgotten_ns is not None and item.stamp_ns <= person.forgotten_ns
        if forgotten or (person.last_stamp_ns is not None and item.stamp_ns < person.last_stamp_ns - self._history_ns):
            return Reason.STALE
        epoch = person.open.get(item.stamp_ns)
        if item.size + (epoch.sizes[item.kind] if epoch is not None else 0) > CAPACITY[item.kind]:
            return Reason.OVERFLOW
        self._remember(person, item, identity)
        return Reason.ACCEPTED

    def _remember(self, person: _Person, item: SyncInput, identity: tuple[Kind, Hashable, int, int]) -> None:
        person.seen[identity] = None
        if len(person.seen) > _REMEMBERED_INPUTS:
            (*_, stamp_ns), _ = person.seen.popitem(last=False)
            person.forgotten_ns = max(stamp_ns, person.forgotten_ns or stamp_ns)
        if item.kind is not Kind.LINK_STATE:  # links of one round are judged in any order
            person.newest_of_source[item.kind, item.source] = item.stamp_ns
            if len(person.newest_of_source) > _REMEMBERED_SOURCES:
                person.newest_of_source.popitem(last=False)

    def _emit(self, name: str, person: _Person, now_ns: int) -> list[Epoch]:
        """In order of stamp, up to the newest that is due: one that still waits goes out with a later one."""
        due = [e.stamp_ns for e in person.open.values() if now_ns >= e.deadline_ns or self._complete(person, e, now_ns)]
        overfull = sorted(person.open)[: max(0, len(person.open) - self._max_open)]
        last_ns = max([*due, *overfull], default=None)
        if last_ns is None:
            return []
        epochs = []
        for stamp_ns in sorted(stamp for stamp in person.open if stamp <= last_ns):
            opened = person.open.pop(stamp_ns)
            late = person.last_stamp_ns is not None and stamp_ns <= person.last_stamp_ns
            self.late += late
            person.seq += 1
            epochs.append(Epoch(name, person.seq, stamp_ns, late, opened.inputs))
            if not late:
                person.last_stamp_ns = stamp_ns
        if not person.open:
            del self._waiting[name]
        return epochs

    def _complete(self, person: _Person, epoch: _Open, now_ns: int) -> bool:
        if Kind.RANGES not in epoch.inputs:
            return False
        heard_ns = person.link_state_heard_ns
        if epoch.links and heard_ns is not None and now_ns - heard_ns < _LINK_STATES_EXPECTED_NS:
            return epoch.sizes[Kind.LINK_STATE] >= epoch.links
        return Kind.UWB_POSE in epoch.inputs
