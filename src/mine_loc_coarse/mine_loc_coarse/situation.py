"""The situation: a region for each emitter, and who is near whom (paper E, step 6)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from mine_loc_coarse.gallery_stretches import stretches_within
from mine_loc_coarse.region_radius import region_radius_m
from mine_loc_coarse.tracks import Status, Track
from mine_loc_core.site import Gallery


@dataclass(frozen=True, slots=True)
class Region:
    """Where one emitter is: the circle of `radius_m` round `centre_m` holds it with `probability`.

    `covariance_m2` (2, 2), `confidence` that the emitter exists at all, ids of monitors and of regions within
    communication range, the gallery stretches that it covers (none without a map), when it was last heard.
    """

    id: int
    frequency_hz: float
    centre_m: tuple[float, float]
    covariance_m2: NDArray[np.float64]
    radius_m: float
    probability: float
    confidence: float
    monitor_ids: tuple[int, ...]
    neighbour_ids: tuple[int, ...]
    galleries: tuple[str, ...]
    status: Status
    last_heard_ns: int


@dataclass(frozen=True, slots=True)
class Situation:
    """All regions at `stamp_ns`."""

    stamp_ns: int
    regions: tuple[Region, ...]


def situation_of(
    tracks: Sequence[Track],
    stamp_ns: int,
    probability: float,
    range_m: float,
    monitor_ids: Sequence[int],
    galleries: Sequence[Gallery],
) -> Situation:
    """The situation that `tracks` make; neighbours are present emitters within `range_m` of each other."""
    if not tracks:
        return Situation(stamp_ns, ())
    covariance = np.array([track.covariance[:2, :2] for track in tracks])
    radius_m = region_radius_m(covariance, probability).tolist()
    near = _neighbours(tracks, range_m)
    regions = []
    for number, (track, radius) in enumerate(zip(tracks, radius_m, strict=True)):
        centre_m = (float(track.state[0]), float(track.state[1]))
        regions.append(
            Region(
                track.id,
                track.sighting.frequency_hz,
                centre_m,
                covariance[number],
                radius,
                probability,
                track.sighting.confidence,
                tuple(monitor_ids[index] for index in track.sighting.monitors),
                tuple(near[number]),
                tuple(stretches_within(galleries, centre_m, radius)),
                track.status,
                track.sighting.last_heard_ns,
            )
        )
    return Situation(stamp_ns, tuple(regions))


def _neighbours(tracks: Sequence[Track], range_m: float) -> list[list[int]]:
    """Ids of the present emitters within range of each; a lost or ambiguous one has none and is none."""
    present = [number for number, track in enumerate(tracks) if track.status in {Status.NEW, Status.KEPT}]
    near: list[list[int]] = [[] for _ in tracks]
    if len(present) > 1:
        tree = KDTree(np.array([tracks[number].state[:2] for number in present]))
        for i, j in tree.query_pairs(range_m, output_type="ndarray").tolist():
            near[present[i]].append(tracks[present[j]].id)
            near[present[j]].append(tracks[present[i]].id)
    return near
