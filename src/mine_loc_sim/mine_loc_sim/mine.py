"""A mine as radio sees it: what lies between two points, and how far the way round is.

Free space is the union of gallery legs, the discs that join them, and chambers; all else is rock. A place without
galleries and chambers is open. Obstacles and people stand in free space. Map frame, ENU, metres.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from mine_loc_sim import radio_constants as constants
from mine_loc_sim.prism import ConvexPrisms, Floats, Prism, detour, passing_distance, uncovered_length

_JOINT_CORNERS = 8
_TURNING_POINTS_TRIED = 6
_ROUNDING_M = 1e-6
_STRAIGHTNESS_M = 1e-3
"""Added for every turn, so that of equal ways the straightest is taken."""


@dataclass(frozen=True, slots=True)
class LinkGeometry:
    """What `n` links meet on the straight way; arrays are (n,)."""

    distance_m: Floats
    rock_m: Floats  # of the straight way
    loss_db: Floats  # of the straight way through rock, obstacles and other people
    delay_m: Floats  # excess way of the wave that goes through
    detour_m: Floats  # excess way of the shortest way round; 0 where nothing is in the way, inf where there is none
    corners: NDArray[np.int64]  # turns on that way

    @property
    def clear(self) -> NDArray[np.bool_]:
        """Whether nothing at all is in the way."""
        return self.loss_db <= 0.0


def gallery_prisms(centre_line_m: Sequence[Sequence[float]], width_m: float, height_m: float) -> list[Prism]:
    """Legs of a gallery as boxes and a joint at each inner vertex; a sloping leg spans both its ends' heights."""
    line = np.asarray(centre_line_m, float)
    prisms = []
    for start, end in itertools.pairwise(line):
        along = (end - start)[:2] / np.linalg.norm((end - start)[:2])
        side = 0.5 * width_m * np.array([-along[1], along[0]])
        corners = np.array([start[:2] + side, start[:2] - side, end[:2] - side, end[:2] + side])
        prisms.append(Prism(corners, min(start[2], end[2]), max(start[2], end[2]) + height_m))
    angle = np.arange(_JOINT_CORNERS) * (2.0 * np.pi / _JOINT_CORNERS)
    ring = 0.5 * width_m * np.column_stack([np.cos(angle), np.sin(angle)])
    prisms += [Prism(vertex[:2] + ring, vertex[2], vertex[2] + height_m) for vertex in line[1:-1]]
    return prisms


def rock_length(free: ConvexPrisms, start_m: Floats, end_m: Floats) -> Floats:
    """Length [m] of segments (n, 3) that runs outside all of `free`; 0 where nothing is dug and the place is open."""
    length = np.linalg.norm(end_m - start_m, axis=1)
    if not len(free.owner):
        return np.zeros(len(length))
    rock = uncovered_length(free.spans(start_m, end_m), length)
    return np.where(rock > _ROUNDING_M, rock, 0.0)


@dataclass(frozen=True, slots=True)
class Ways:
    """Shortest ways through free space between `w` turning points."""

    points_m: Floats  # (w, 3)
    length_m: Floats  # (w, w)
    turns: NDArray[np.int64]  # (w, w), turns on the way from the one to the other

    @staticmethod
    def between(free: ConvexPrisms, points_m: Floats) -> "Ways":
        """Join points in sight of each other."""
        count = len(points_m)
        first, second = np.divmod(np.arange(count * count), max(count, 1))
        straight = np.linalg.norm(points_m[first] - points_m[second], axis=1) + _STRAIGHTNESS_M
        hidden = rock_length(free, points_m[first], points_m[second]) > 0.0
        graph = np.where(hidden, 0.0, straight).reshape(count, count)
        length, before = (
            dijkstra(graph, directed=False, return_predecessors=True) if count else (graph, graph.astype(int))
        )
        turns = np.zeros((count, count), int)
        for row in range(count):
            for target in np.argsort(length[row]):
                if before[row, target] >= 0:
                    turns[row, target] = turns[row, before[row, target]] + 1
        return Ways(points_m, length, turns)

    def around(self, free: ConvexPrisms, start_m: Floats, end_m: Floats) -> tuple[Floats, NDArray[np.int64]]:
        """Length of the shortest way from start to end, (n, 3) each, and its turns; inf and 0 where there is none."""
        count = len(start_m)
        if not len(self.points_m):
            return np.full(count, np.inf), np.zeros(count, int)
        from_start, first = self._in_sight(free, start_m)
        from_end, last = self._in_sight(free, end_m)
        total = from_start[:, :, None] + self.length_m[first[:, :, None], last[:, None, :]] + from_end[:, None, :]
        total = total.reshape(count, -1)
        best = total.argmin(axis=1)
        rows, width = np.arange(count), last.shape[1]
        turns = self.turns[first[rows, best // width], last[rows, best % width]] + 1
        shortest = total[rows, best]
        return shortest, np.where(np.isfinite(shortest), turns, 0)

    def _in_sight(self, free: ConvexPrisms, points_m: Floats) -> tuple[Floats, NDArray[np.int64]]:
        """Distances to the nearest turning points, inf to those out of sight, and their numbers: (n, tried) each.

        Links share their ends: each place is looked from once.
        """
        number = dict[tuple[float, ...], int]()
        place = [number.setdefault(tuple(point), len(number)) for point in points_m.tolist()]
        distance_m, near = self._sight_of(free, np.array(list(number)))
        return distance_m[place], near[place]

    def _sight_of(self, free: ConvexPrisms, points_m: Floats) -> tuple[Floats, NDArray[np.int64]]:
        distance = np.linalg.norm(points_m[:, None] - self.points_m[None], axis=2)
        near = np.argsort(distance, axis=1)[:, :_TURNING_POINTS_TRIED]
        starts = np.repeat(points_m, near.shape[1], axis=0)
        hidden = rock_length(free, starts, self.points_m[near.ravel()]).reshape(near.shape) > 0.0
        return np.where(hidden, np.inf, np.take_along_axis(distance, near, axis=1)), near


@dataclass(frozen=True, slots=True)
class Mine:
    """Geometry of one place."""

    free: ConvexPrisms
    obstacles: tuple[Prism, ...]
    obstacle_parts: ConvexPrisms
    ways: Ways

    @staticmethod
    def build(
        free: Sequence[Prism] = (), obstacles: Sequence[Prism] = (), turning_points_m: Floats | None = None
    ) -> "Mine":
        """Prepare a mine; turning_points_m: (w, 3) places in free space where ways round a corner may turn."""
        hollow = ConvexPrisms.of(free)
        points_m = np.empty((0, 3)) if turning_points_m is None else turning_points_m
        return Mine(hollow, tuple(obstacles), ConvexPrisms.of(obstacles), Ways.between(hollow, points_m))

    def with_obstacles(self, extra: Sequence[Prism]) -> "Mine":
        """The same mine with vehicles where they stand now."""
        obstacles = self.obstacles + tuple(extra)
        return replace(self, obstacles=obstacles, obstacle_parts=ConvexPrisms.of(obstacles))

    def look(self, start_m: Floats, end_m: Floats, people_m: Floats | None = None) -> LinkGeometry:
        """Follow links from start to end, (n, 3) each, past other people at (n, p, 2)."""
        distance = np.linalg.norm(end_m - start_m, axis=1)
        rock = rock_length(self.free, start_m, end_m)
        stone = constants.MATTER["rock"]
        loss = np.where(rock > 0.0, rock * stone.loss_db_per_m + stone.surface_loss_db, 0.0)
        delay = rock * stone.delay_index
        way_round = np.zeros(len(distance))
        spans = self.obstacle_parts.spans(start_m, end_m)
        inside = (spans[..., 1] - spans[..., 0]) * distance[:, None]
        for number in np.unique(self.obstacle_parts.owner[(inside > 0.0).any(axis=0)]):
            prism, matter = self.obstacles[number], constants.MATTER[self.obstacles[number].material]
            thickness = inside[:, self.obstacle_parts.owner == number].sum(axis=1)
            hit = thickness > 0.0
            loss += np.where(hit, thickness * matter.loss_db_per_m + matter.surface_loss_db, 0.0)
            delay += thickness * matter.delay_index
            way_round[hit] = np.maximum(way_round[hit], detour(prism, start_m[hit], end_m[hit]))
        if people_m is not None:
            loss += _crowd_loss_db(start_m, end_m, people_m)
        corners = np.zeros(len(distance), int)
        buried = rock > 0.0
        if buried.any():
            around, corners[buried] = self.ways.around(self.free, start_m[buried], end_m[buried])
            way_round[buried] = np.maximum(way_round[buried], around - distance[buried])
        return LinkGeometry(distance, rock, loss, delay, way_round, corners)


def _crowd_loss_db(start_m: Floats, end_m: Floats, people_m: Floats) -> Floats:
    """Loss by people on the way: full in the middle of a body, none at its edge, adding up."""
    full = 0.5 * sum(constants.BODY_LOSS_DB)
    middle, reach = 0.5 * (start_m + end_m)[:, None, :2], 0.5 * np.linalg.norm(end_m - start_m, axis=1)[:, None]
    away = people_m - middle
    link, person = np.nonzero((away**2).sum(axis=2) < (reach + constants.BODY_RADIUS_M) ** 2)
    apart = passing_distance(people_m[link, person], start_m[link], end_m[link])
    loss = full * np.sqrt(np.maximum(1.0 - (apart / constants.BODY_RADIUS_M) ** 2, 0.0))
    return np.bincount(link, loss, len(start_m)).astype(np.float64)
