"""A recording as our own devices would have reported it, with the truth that its makers measured beside it.

What an importer makes and a bag is written from: all instants are integer ns of ROS time, lengths in metres.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import nan
from typing import Any

import numpy as np
import numpy.typing as npt

from mine_loc_pdr.n100_stream import ImuMeasurement
from mine_loc_uwb.ranging import CirWindow, RangingRound

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Vector3 = tuple[float, float, float]

START_NS = 1_700_000_000 * 10**9
"""ROS time at which recordings begin whose makers do not tell when they were made."""
NO_FIELD: Vector3 = (nan, nan, nan)
"""Of an IMU without magnetometer."""


@dataclass(frozen=True, slots=True)
class Instant:
    """When something was measured, and when it was known; a measurement is never known before it was made."""

    stamp_ns: int
    arrival_ns: int


@dataclass(frozen=True, slots=True, eq=False)
class TrueTrack:
    """Poses of one person at increasing `stamp_ns` (n,): `position_m` (n, 3), `orientation_wxyz` (n, 4).

    `frame` is the map frame of the site, or that of the system that measured.
    """

    person: str
    frame: str
    stamp_ns: Integers
    position_m: Array
    orientation_wxyz: Array


@dataclass(frozen=True, slots=True)
class MarkedStep:
    """A heel strike that somebody marked; where and how far is not known."""

    person: str
    stamp_ns: int


@dataclass(frozen=True, slots=True)
class LabelledLink:
    """Which of the classes 1 to 4 of mine_loc_interfaces/LinkState a link may be in at an instant."""

    stamp_ns: int
    tag_id: int
    anchor_id: int
    allowed: tuple[bool, bool, bool, bool]


@dataclass(frozen=True, slots=True)
class Recording:
    """One recording. `site` and `people` are what site.yaml and people.yaml say of it.

    `stamp_offset_ns` of the ranges of a round is `Range.ticks_offset`, in ns. Samples of an IMU (by person) come with
    their arrival. Each sequence is in order of arrival.
    """

    name: str
    site: Mapping[str, Any]
    people: Sequence[Mapping[str, Any]]
    rounds: Sequence[tuple[Instant, RangingRound]] = ()
    accumulators: Sequence[tuple[Instant, CirWindow]] = ()
    imu: Mapping[str, Sequence[tuple[int, ImuMeasurement]]] = field(default_factory=dict)
    tracks: Sequence[TrueTrack] = ()
    steps: Sequence[MarkedStep] = ()
    links: Sequence[LabelledLink] = ()


def upright(count: int) -> Array:
    """Orientations (count, 4) of what is only known to have a place: no turn."""
    return np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))


def site_content(
    name: str, anchors_m: Mapping[int, Vector3], *, tag_height_m: float, names: Mapping[int, str] | None = None
) -> dict[str, Any]:
    """What site.yaml says of a planar site."""
    anchors = [
        {"id": number, **({"name": names[number]} if names else {}), "position_m": list(place)}
        for number, place in anchors_m.items()
    ]
    return {"schema": 1, "name": name, "dimensions": 2, "tag_height_m": tag_height_m, "anchors": anchors}
