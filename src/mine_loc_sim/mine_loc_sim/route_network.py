"""Where people can walk in a site: its galleries and chambers as a network, or the open ground about its anchors.

Random ways through it are drawn as way-points; `route.plan_route` makes walking of them.
"""

import itertools
import math

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.site import Site
from mine_loc_sim import scene_constants as sc
from mine_loc_sim.prism import ConvexPrisms, Prism, contains
from mine_loc_sim.route import WayPoint

Array = NDArray[np.float64]
_SAME_PLACE_M = 0.6
_SHORTEST_LEG_M = 1.0
_WAIST_M = 1.0
_TRIES = 60


class RouteNetwork:
    """Nodes (n, 3) [m, on the floor] with the room to either side (n,) [m], and which are joined by a straight way.

    A site without galleries and chambers has no nodes: there people walk in `box_m` (2, 2), lowest and highest x, y.
    """

    def __init__(self, site: Site, obstacles: ConvexPrisms) -> None:
        self._obstacles = obstacles
        self._nodes: list[Array] = []
        self._room_m: list[float] = []
        self._joined: dict[int, set[int]] = {}
        for gallery in site.galleries:
            room_m = max(gallery.width_m * sc.LATERAL_SHARE, 0.0)
            line = [self._node(np.array(point), room_m) for point in gallery.centre_line_m]
            for a, b in itertools.pairwise(line):
                self._join(a, b)
        self._split_at_junctions()
        for chamber in site.chambers:
            self._open_chamber(np.array(chamber.polygon_m), chamber.floor_m)
        self._box_m = _box(site)
        if not self._joined and self._box_m is None:
            raise ConfigurationError(
                f"site {site.name}: nowhere to walk; allowed: a site with galleries, anchors or monitors"
            )

    def walk(self, rng: np.random.Generator, length_m: float) -> list[WayPoint]:
        """Draw a way of at least `length_m` through the network or over open ground."""
        return self._network_walk(rng, length_m) if self._joined else self._open_walk(rng, length_m)

    def _network_walk(self, rng: np.random.Generator, length_m: float) -> list[WayPoint]:
        pairs = [(a, b) for a, others in self._joined.items() for b in others]
        lengths = np.array([np.linalg.norm(self._nodes[a] - self._nodes[b]) for a, b in pairs])
        for _ in range(_TRIES):
            last, goal = pairs[rng.choice(len(pairs), p=lengths / lengths.sum())]
            here = self._beside(rng, last, goal, rng.uniform(0.1, 0.9))
            if not self._crowded(here):
                break
        else:
            raise ConfigurationError("galleries: no place free of obstacles was found; allowed: room to walk")
        points, walked, refused = [WayPoint(_point(here), pause_s=_first_pause(rng))], 0.0, 0
        while walked < length_m:
            half_way = rng.random() < sc.TURN_BACK_SHARE or refused > 1
            there = self._beside(rng, last, goal, rng.uniform(0.0, 1.0) if half_way else 1.0)
            step_m = float(np.linalg.norm(there - here))
            if step_m < _SHORTEST_LEG_M or self._blocked(here, there):
                refused += 1
                if refused > _TRIES:
                    raise ConfigurationError(f"no way on from {_point(here)}; allowed: galleries with room to walk")
                last, goal = goal, last
                continue
            points.append(WayPoint(_point(there), pause_s=_pause(rng)))
            here, walked, refused = there, walked + step_m, 0
            last, goal = (goal, last) if half_way else (goal, self._next(rng, last, goal))
        return points

    def _next(self, rng: np.random.Generator, last: int, node: int) -> int:
        """Go on from `node`, back to `last` only from a dead end."""
        onward = sorted(self._joined[node] - {last})
        return int(rng.choice(onward)) if onward else last

    def _beside(self, rng: np.random.Generator, start: int, goal: int, share: float) -> Array:
        """Return a place that share of the way from one node to the other, somewhat to the side, before a dead end."""
        way = self._nodes[goal] - self._nodes[start]
        length_m = float(np.linalg.norm(way))
        if len(self._joined[goal]) == 1:
            share = min(share, 1.0 - sc.CLEARANCE_M / length_m)
        aside_m = rng.uniform(-1.0, 1.0) * min(self._room_m[start], self._room_m[goal])
        place: Array = self._nodes[start] + share * way + aside_m / length_m * np.array([-way[1], way[0], 0.0])
        return place

    def _open_walk(self, rng: np.random.Generator, length_m: float) -> list[WayPoint]:
        assert self._box_m is not None
        low, high = self._box_m
        here = np.append(rng.uniform(low, high), 0.0)
        while self._crowded(here):
            here = np.append(rng.uniform(low, high), 0.0)
        points, walked = [WayPoint(_point(here), pause_s=_first_pause(rng))], 0.0
        diagonal_m = float(np.linalg.norm(high - low))
        legs_m = min(sc.OPEN_LEG_M[0], 0.3 * diagonal_m), min(sc.OPEN_LEG_M[1], 0.7 * diagonal_m)
        while walked < length_m:
            for _ in range(_TRIES):
                angle, leg_m = rng.uniform(-math.pi, math.pi), rng.uniform(*legs_m)
                there = here + leg_m * np.array([math.cos(angle), math.sin(angle), 0.0])
                if np.all(there[:2] >= low) and np.all(there[:2] <= high) and not self._blocked(here, there):
                    break
            else:
                raise ConfigurationError(f"no way on from {_point(here)}; allowed: obstacles that leave room to walk")
            points.append(WayPoint(_point(there), pause_s=_pause(rng)))
            here, walked = there, walked + leg_m
        return points

    def _crowded(self, place: Array) -> bool:
        aside = np.array([0.01, 0.0, 0.0])
        return self._blocked(place - aside, place + aside)

    def _blocked(self, here: Array, there: Array) -> bool:
        """Whether the straight way, or a body's width beside it, meets an obstacle."""
        along = (there - here)[:2] / np.linalg.norm((there - here)[:2])
        side = sc.CLEARANCE_M * np.array([-along[1], along[0], 0.0])
        ahead = sc.CLEARANCE_M * np.append(along, 0.0)
        offsets = np.stack([side, -side, 0.0 * side]) + np.array([0.0, 0.0, _WAIST_M])
        spans = self._obstacles.spans(here + offsets - ahead, there + offsets + ahead)
        return bool(np.any(spans[..., 1] > spans[..., 0]))

    def _node(self, place: Array, room_m: float) -> int:
        for number, known in enumerate(self._nodes):
            if np.linalg.norm(known - place) < _SAME_PLACE_M:
                self._room_m[number] = min(self._room_m[number], room_m)
                return number
        self._nodes.append(place)
        self._room_m.append(room_m)
        return len(self._nodes) - 1

    def _join(self, a: int, b: int) -> None:
        self._joined.setdefault(a, set()).add(b)
        self._joined.setdefault(b, set()).add(a)

    def _split_at_junctions(self) -> None:
        """Where a gallery begins on the leg of another, that leg passes through the junction."""
        for node, place in enumerate(self._nodes):
            for a, b in [(a, b) for a, others in self._joined.items() for b in others if a < b]:
                if node in {a, b}:
                    continue
                start, way = self._nodes[a], self._nodes[b] - self._nodes[a]
                share = float((place - start) @ way / (way @ way))
                if 0.0 < share < 1.0 and np.linalg.norm(start + share * way - place) < _SAME_PLACE_M:
                    self._joined[a].discard(b)
                    self._joined[b].discard(a)
                    self._join(a, node)
                    self._join(node, b)

    def _open_chamber(self, polygon_m: Array, floor_m: float) -> None:
        """Join a free place near the chamber's middle to the gallery ends that lie in it or at its wall."""
        room = ConvexPrisms.of([Prism(polygon_m, floor_m - 1.0, floor_m + 1.0)])
        middle = np.append(polygon_m.mean(axis=0), floor_m)
        inward = [place + 0.02 * (middle - place) for place in self._nodes]
        dead_ends = [number for number in range(len(self._nodes)) if len(self._joined.get(number, ())) == 1]
        ends = [number for number in dead_ends if contains(room, inward[number][None])[0]]
        free = [self._free_place(room, polygon_m, middle, self._nodes[end]) for end in ends]
        for end, place in zip(ends, free, strict=True):
            if place is not None:
                self._join(end, self._node(place, 0.0))

    def _free_place(self, room: ConvexPrisms, polygon_m: Array, middle: Array, door: Array) -> Array | None:
        """Return the place nearest the middle, on a grid, to which a straight way leads from the door."""
        columns, rows = (
            np.linspace(low + 1.0, high - 1.0, 9) for low, high in zip(polygon_m.min(0), polygon_m.max(0), strict=True)
        )
        places = [np.array([x, y, middle[2]]) for x in columns for y in rows]
        for place in sorted(places, key=lambda p: float(np.linalg.norm(p - middle))):
            far_enough = np.linalg.norm(place - door) > _SHORTEST_LEG_M
            if far_enough and contains(room, place[None])[0] and not self._blocked(door, place):
                return place
        return None


def _box(site: Site) -> Array | None:
    """Ground about the fixed anchors, or the monitors where there are none, as lowest and highest x, y."""
    places = [anchor.position_m[:2] for anchor in site.fixed_anchors]
    places += [vehicle.position_m[:2] for vehicle in site.vehicles if vehicle.anchor_ids]
    places = places or [monitor.position_m[:2] for monitor in site.monitors]
    if not places:
        return None
    reach = sc.OPEN_MARGIN_M + max([0.0, *(max(v.size_m[:2]) for v in site.vehicles if v.anchor_ids)])
    return np.array([np.min(places, axis=0) - reach, np.max(places, axis=0) + reach])


def _pause(rng: np.random.Generator) -> float:
    return float(rng.uniform(*sc.PAUSE_S)) if rng.random() < sc.PAUSE_SHARE else 0.0


def _first_pause(rng: np.random.Generator) -> float:
    """Stand at first, as people do who have just put on their gear: inertial sensors need some rest."""
    return float(rng.uniform(*sc.PAUSE_S))


def _point(place: Array) -> tuple[float, float, float]:
    return float(place[0]), float(place[1]), float(place[2])
