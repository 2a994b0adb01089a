"""Identity of emitters over time (paper E, step 5): frequency and motion tell which sighting is which emitter.

A situation rests on a whole window, so one missed report changes nothing, and a late one corrects the sighting by its
motion. A track that is not sighted goes on by its velocity with a growing covariance, is LOST after a while and
forgotten later. It is dropped at once only when the very reports that made it turn out to be others'.
"""

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from mine_loc_coarse.settings import CoarseSettings
from mine_loc_coarse.sighting import Sighting
from mine_loc_core.gates import chi2_quantile
from mine_loc_core.stamps import NS_PER_S, to_ns

Array = NDArray[np.float64]
_GATE = chi2_quantile(0.9999, 4)
_NO_MATCH = 1e9
_MOST_TRACKS = 4096


class Status(IntEnum):
    """The same numbers as in mine_loc_interfaces/CoarseRegion."""

    NEW = 1
    KEPT = 2
    LOST = 3
    AMBIGUOUS = 4


@dataclass(frozen=True, slots=True)
class Track:
    """An emitter with its identity; `state` and `covariance` hold for `stamp_ns`, `stated_ns` is when it was first
    stated (None = never)."""

    id: int
    sighting: Sighting
    state: Array
    covariance: Array
    stamp_ns: int
    stated_ns: int | None
    status: Status


class Tracks:
    """The tracks of a field. At most 4096: beyond that, `overflow` counts emitters without a track."""

    def __init__(self, settings: CoarseSettings) -> None:
        self._settings = settings
        self._next_id = 1
        self.overflow = 0
        self.tracks: list[Track] = []

    def forget(self) -> None:
        """Drop all tracks; numbers are not used again."""
        self.tracks = []

    def predicted(self, now_ns: int) -> list[Track]:
        """All tracks as they are expected to be at `now_ns`."""
        return [self._moved(track, now_ns) for track in self.tracks]

    def update(
        self, sightings: Sequence[Sighting], emission_hz: Array, spare: Collection[int], now_ns: int
    ) -> list[Track]:
        """Match the sightings of a window to the tracks and return all tracks.

        `emission_hz` (e,) are the frequencies of the window's emissions, `spare` the emissions with reports that belong
        to no sighting.
        """
        expected = self.predicted(now_ns)
        on = self._by_emission(expected, emission_hz)
        seen: dict[int, list[int]] = defaultdict(list)
        for index, sighting in enumerate(sightings):
            seen[sighting.emission].append(index)
        matched: dict[int, int] = {}
        for emission, own in seen.items():
            matched |= _matched(own, on.get(emission, ()), sightings, expected)
        emission_of = {number: emission for emission, numbers in on.items() for number in numbers}
        taken = set(matched.values())
        kept = [
            track
            for number, track in enumerate(expected)
            if number not in taken and self._stays(track, emission_of.get(number), seen, spare, now_ns)
        ]
        kept = [replace(track, status=self._status_unseen(track, now_ns)) for track in kept]
        for index, sighting in enumerate(sightings):
            if index in matched:
                kept.append(self._seen_again(expected[matched[index]], sighting, now_ns))
            elif len(kept) < _MOST_TRACKS:
                kept.append(self._new(sighting, now_ns))
            else:
                self.overflow += 1
        self.tracks = kept
        return kept

    def _by_emission(self, expected: Sequence[Track], emission_hz: Array) -> Mapping[int, Sequence[int]]:
        """Numbers of the tracks on each emission."""
        if not len(emission_hz) or not expected:
            return {}
        order = np.argsort(emission_hz)
        hz = np.array([track.sighting.frequency_hz for track in expected])
        place = np.searchsorted(emission_hz[order], hz)
        below, above = np.maximum(place - 1, 0), np.minimum(place, len(order) - 1)
        nearer = np.where(
            np.abs(emission_hz[order[below]] - hz) < np.abs(emission_hz[order[above]] - hz), order[below], order[above]
        )
        near = np.abs(emission_hz[nearer] - hz) <= 2.0 * self._settings.frequency_accuracy_hz
        on: dict[int, list[int]] = defaultdict(list)
        for number in np.flatnonzero(near).tolist():
            on[int(nearer[number])].append(number)
        return on

    def _moved(self, track: Track, now_ns: int) -> Track:
        seconds = (now_ns - track.stamp_ns) / NS_PER_S
        if seconds == 0.0:
            return track
        move = np.eye(4)
        move[0, 2] = move[1, 3] = seconds
        covariance = move @ track.covariance @ move.T
        # A walker turns: while unseen, the place spreads as by a walk of independent courses, once a window each.
        spread = self._settings.speed_m_s**2 / 2.0 * abs(seconds) * min(abs(seconds), self._settings.window_s)
        covariance[0, 0] += spread
        covariance[1, 1] += spread
        return replace(track, state=move @ track.state, covariance=covariance, stamp_ns=now_ns)

    def _stays(
        self,
        track: Track,
        emission: int | None,
        seen: Mapping[int, Sequence[int]],
        spare: Collection[int],
        now_ns: int,
    ) -> bool:
        if track.status is Status.AMBIGUOUS:
            return False
        silence_ns = now_ns - track.sighting.last_heard_ns
        if silence_ns > to_ns(self._settings.forget_after_s):
            return False
        others_took_its_reports = emission in seen and emission not in spare
        return not (others_took_its_reports and silence_ns < to_ns(self._settings.lost_after_s))

    def _status_unseen(self, track: Track, now_ns: int) -> Status:
        silent = now_ns - track.sighting.last_heard_ns > to_ns(self._settings.lost_after_s)
        return Status.LOST if silent else Status.KEPT

    def _seen_again(self, track: Track, sighting: Sighting, now_ns: int) -> Track:
        stated_ns = track.stated_ns
        if not sighting.stated:
            status = Status.AMBIGUOUS
        elif stated_ns is None:
            status, stated_ns = Status.NEW, now_ns
        else:
            status = self._status_unseen(replace(track, sighting=sighting), now_ns)
        return Track(track.id, sighting, sighting.state, sighting.covariance, now_ns, stated_ns, status)

    def _new(self, sighting: Sighting, now_ns: int) -> Track:
        self._next_id = self._next_id % (2**32 - 1) + 1
        number = self._next_id - 1 or 2**32 - 1
        status, stated_ns = (Status.NEW, now_ns) if sighting.stated else (Status.AMBIGUOUS, None)
        return Track(number, sighting, sighting.state, sighting.covariance, now_ns, stated_ns, status)


def _matched(
    seen: Sequence[int], tracks: Sequence[int], sightings: Sequence[Sighting], expected: Sequence[Track]
) -> dict[int, int]:
    """Sightings of one emission to its tracks, each at most once, with the least sum of squared distances."""
    if not tracks:
        return {}
    cost = np.array([[_squared_distance(sightings[s], expected[t]) for t in tracks] for s in seen])
    rows, columns = linear_sum_assignment(np.where(cost <= _GATE, cost, _NO_MATCH))
    return {seen[r]: tracks[c] for r, c in zip(rows, columns, strict=True) if cost[r, c] <= _GATE}


def _squared_distance(sighting: Sighting, track: Track) -> float:
    """Mahalanobis' distance squared of place and velocity."""
    offset = sighting.state - track.state
    return float(offset @ np.linalg.solve(sighting.covariance + track.covariance, offset))
