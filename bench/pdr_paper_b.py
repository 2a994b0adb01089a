"""Paper B's pseudo-plane on simulated walks: position with and without markers and galleries.

    python bench/pdr_paper_b.py            score every scene, as bench/pdr.py does
    python bench/pdr_paper_b.py --knobs    the rows without correction on the knobs' seeds, for values of the knob

Error: horizontal distance between the position as it was reported with a step, corrections until then and no later ones
included, and where the waist was at the step's stamp. A walk's figure is the mean over its steps. Rows:

* `before`: dead reckoning alone, from the start that is told;
* `reset`: paper B's method, the position reset to the marker (its equation 14);
* `after`: `MapTrack` with the markers;
* `gallery`: `MapTrack` with the markers, the galleries' centre lines and widths.

`turn_*` are of the walk with a single turn, over the steps from 1.25 s after the turn was over, when it is known;
`turn_*_live` from its beginning. `per_person` is over people and seeds, `averaged` of the mean of six tracks, as in the
paper's figure 7, at equal shares of the way.
"""

import argparse
import json
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from gait_recordings import Array
from pdr_tracks import spread
from pdr_walks import Crew, Scene, Walk

from mine_loc_core.stamps import NS_PER_S
from mine_loc_core.walkable_area import WalkableArea
from mine_loc_pdr.dead_reckoning import StepEvent
from mine_loc_pdr.gallery_constraint import GalleryConstraint
from mine_loc_pdr.map_track import MapPose
from mine_loc_pdr.plane_follower import PlaneFollower
from mine_loc_pdr.pseudo_plane import LandmarkFix, PseudoPlane
from mine_loc_pdr.stride import PENDULUM_SCALE_VARIANCE
from mine_loc_pdr.turns import Turn, TurnDetector

SCENES = ("training_hall", "long_galleries")
KNOWN_AFTER_NS = 5 * NS_PER_S // 4
START_SD_M, START_YAW_SD_RAD = 0.1, math.radians(3.0)  # of who is told to stand on a mark and face along the gallery
SHARES = np.linspace(0.0, 1.0, 201)
KNOB_VALUES = (0.0, 0.01, 0.02, 0.03)


class Method(Protocol):
    """Follows one walk."""

    def push(self, stamp_ns: int, heading_rad: float, steps: Sequence[StepEvent]) -> LandmarkFix | None:
        """Take what dead reckoning reports with a sample."""

    def position_m(self) -> Array:
        """Now, (2,)."""

    def covariance_m2(self) -> Array | None:
        """Of it, (2, 2), where the method has one."""


class Reset:
    """Paper B: dead reckoning in the map, put onto the marker of a turn. Without markers, dead reckoning alone."""

    def __init__(self, walk: Walk, plane: PseudoPlane | None) -> None:
        self._plane = plane
        self._turns = TurnDetector()
        c, s = math.cos(walk.start_yaw_rad), math.sin(walk.start_yaw_rad)
        self._to_map = np.array([[c, -s], [s, c]])
        self._track = [(walk.reports[0].stamp_ns, *walk.start_m)]
        self._start_m, self._shift_m = np.array(walk.start_m), np.zeros(2)

    def push(self, stamp_ns: int, heading_rad: float, steps: Sequence[StepEvent]) -> LandmarkFix | None:
        """See Method."""
        for step in steps:
            x_m, y_m = self._start_m + self._to_map @ [step.x_m, step.y_m]
            self._track.append((step.stamp_ns, float(x_m), float(y_m)))
        turn = self._turns.push(stamp_ns, heading_rad)
        return None if turn is None or self._plane is None else self._match(self._plane, turn)

    def position_m(self) -> Array:
        """See Method."""
        position: Array = np.array(self._track[-1][1:]) + self._shift_m
        return position

    def covariance_m2(self) -> None:
        """See Method."""

    def _match(self, plane: PseudoPlane, turn: Turn) -> LandmarkFix | None:
        stamps, x, y = np.array(self._track).T
        middle_m = np.array([np.interp(turn.middle_ns, stamps, x), np.interp(turn.middle_ns, stamps, y)])
        fix = plane.match(turn, middle_m + self._shift_m)
        if fix is not None and fix.marker is not None:
            self._shift_m = np.array(fix.marker.position_m[:2]) - middle_m
        return fix


class Follower:
    """What the node runs."""

    def __init__(self, walk: Walk, plane: PseudoPlane, galleries: GalleryConstraint | None) -> None:
        self._follower = PlaneFollower(plane, galleries)
        covariance = np.diag([START_SD_M**2, START_SD_M**2, START_YAW_SD_RAD**2])
        first = walk.reports[0]
        self._follower.push(first.stamp_ns, first.heading_rad, ())
        start = MapPose(first.stamp_ns, *walk.start_m, walk.start_yaw_rad, covariance)
        self._follower.set_pose(start, PENDULUM_SCALE_VARIANCE, walk.bias_sd_rad_s)

    def push(self, stamp_ns: int, heading_rad: float, steps: Sequence[StepEvent]) -> LandmarkFix | None:
        """See Method."""
        return self._follower.push(stamp_ns, heading_rad, steps)

    def position_m(self) -> Array:
        """See Method."""
        pose = self._follower.pose
        return np.full(2, np.nan) if pose is None else np.array([pose.x_m, pose.y_m])

    def covariance_m2(self) -> Array | None:
        """See Method."""
        pose = self._follower.pose
        return None if pose is None else pose.covariance[:2, :2]


@dataclass(frozen=True, slots=True)
class Scored:
    """One method on one walk: at each step its stamp, position and truth (n, 2), and what became of the turns."""

    stamps_ns: Array
    position_m: Array
    truth_m: Array
    nees: Array
    verdicts: Counter[str]

    def error_m(self, since_ns: float = 0.0) -> float:
        """Mean over the steps since an instant."""
        late = self.stamps_ns >= since_ns
        return float(np.linalg.norm((self.position_m - self.truth_m)[late], axis=1).mean())


def methods(scene: Scene) -> Mapping[str, Callable[[Walk], Method]]:
    """The rows, by name."""
    plane = PseudoPlane(scene.site.turn_markers)
    area = WalkableArea.of(scene.site)
    galleries = None if area is None else GalleryConstraint(area)
    return {
        "before": lambda walk: Reset(walk, None),
        "reset": lambda walk: Reset(walk, plane),
        "after": lambda walk: Follower(walk, plane, None),
        "gallery": lambda walk: Follower(walk, plane, galleries),
    }


def follow(method: Method, walk: Walk) -> Scored:
    """Push a walk through a method, as the node does."""
    stamps_ns, positions, covariances, verdicts = [], [], [], Counter[str]()
    for report in walk.reports:
        fix = method.push(report.stamp_ns, report.heading_rad, report.steps)
        if fix is not None:
            verdicts[fix.verdict.name.lower()] += 1
        if report.steps:
            stamps_ns.append(report.steps[-1].stamp_ns)
            positions.append(method.position_m())
            covariances.append(method.covariance_m2())
    truth_m = walk.truth_m(stamps_ns)
    pairs = zip(np.array(positions) - truth_m, covariances, strict=True)
    nees = [off @ np.linalg.solve(covariance, off) for off, covariance in pairs if covariance is not None]
    return Scored(np.array(stamps_ns), np.array(positions), truth_m, np.array(nees), verdicts)


def paper_b() -> dict[str, Any]:
    """All scenes; the figures that stand for paper B's are those of the training hall."""
    first, *harder = (score_scene(Scene.read(name)) for name in SCENES)
    return {**first, "harder": dict(zip(SCENES[1:], harder, strict=True))}


def score_scene(scene: Scene) -> dict[str, Any]:
    """Every method on both ways, all people and seeds."""
    first, last = scene.walks["seeds"]
    turn_ways, route_ways = [], []
    for seed in range(first, last + 1):
        crew = Crew(scene, seed)
        turn_ways.append(crew.walk("turn_way_m"))
        route_ways.append(crew.walk("route_way_m"))
    figures: dict[str, Any] = {"people": len(turn_ways[0]), "seeds": len(turn_ways), "per_person": {}, "averaged": {}}
    figures["corners_of_routes"] = sum(_corners(walk) for walks in route_ways for walk in walks)
    for name, method in methods(scene).items():
        turn = [[follow(method(walk), walk) for walk in walks] for walks in turn_ways]
        route = [[follow(method(walk), walk) for walk in walks] for walks in route_ways]
        figures["per_person"] |= _per_person(name, turn, turn_ways, route)
        figures["averaged"] |= _averaged(name, turn, turn_ways, route, route_ways)
        if name != "before":
            figures[f"route_{name}_verdicts"] = dict(sum((s.verdicts for crew in route for s in crew), Counter()))
        if len(route[0][0].nees):
            figures[f"route_{name}_nees"] = round(float(np.mean([s.nees.mean() for c in route for s in c])), 2)
    return figures


def _corners(walk: Walk) -> int:
    """Turns that a marker may be meant by, without the wandering along a leg."""
    return sum(abs(turn.angle_rad) > math.radians(45.0) for turn in walk.walker.turns())


def _per_person(
    name: str, turn: Sequence[Sequence[Scored]], ways: Sequence[Sequence[Walk]], route: Sequence[Sequence[Scored]]
) -> dict[str, Any]:
    known, live = [], []
    for crew, walks in zip(turn, ways, strict=True):
        turns = [walk.walker.turns() for walk in walks]
        known.append([s.error_m(t[-1].stop_ns + KNOWN_AFTER_NS) for s, t in zip(crew, turns, strict=True)])
        live.append([s.error_m(t[-1].start_ns) for s, t in zip(crew, turns, strict=True)])
    whole = [[s.error_m() for s in crew] for crew in route]
    rows = {f"turn_{name}_m": known, f"turn_{name}_live_m": live, f"route_{name}_m": whole}
    return {key: _spread_of_crews(errors) for key, errors in rows.items()}


def _spread_of_crews(errors_m: Sequence[Sequence[float]]) -> dict[str, float]:
    """Over all walks, and the standard deviation of the seeds' means."""
    return {**spread(np.ravel(errors_m)), "sd_of_seeds": round(float(np.std(np.mean(errors_m, axis=1))), 3)}


def _averaged(
    name: str,
    turn: Sequence[Sequence[Scored]],
    turn_ways: Sequence[Sequence[Walk]],
    route: Sequence[Sequence[Scored]],
    route_ways: Sequence[Sequence[Walk]],
) -> dict[str, Any]:
    after_turn = [
        float(np.mean([_share(walk, walk.walker.turns()[-1].stop_ns + KNOWN_AFTER_NS) for walk in walks]))
        for walks in turn_ways
    ]
    turn_m = [_mean_track_error_m(c, w, since) for c, w, since in zip(turn, turn_ways, after_turn, strict=True)]
    route_m = [_mean_track_error_m(c, w, 0.0) for c, w in zip(route, route_ways, strict=True)]
    return {f"turn_{name}_m": spread(turn_m), f"route_{name}_m": spread(route_m)}


def _mean_track_error_m(crew: Sequence[Scored], walks: Sequence[Walk], since: float) -> float:
    """Error of the mean of all people's tracks at equal shares of the way, from a share on."""
    shares = SHARES[since <= SHARES]
    off = [
        _at_shares(s.position_m - s.truth_m, _share(w, s.stamps_ns), shares) for s, w in zip(crew, walks, strict=True)
    ]
    return float(np.linalg.norm(np.mean(off, axis=0), axis=1).mean())


def _at_shares(values: Array, at: Array, shares: Array) -> Array:
    return np.column_stack([np.interp(shares, at, column) for column in values.T])


def _share(walk: Walk, stamps_ns: Array | int) -> Any:
    """How much of the way was walked at stamps, 0..1."""
    steps = walk.walker.steps()
    walked_m = np.cumsum([step.length_m for step in steps])
    return np.interp(stamps_ns, [step.stamp_ns for step in steps], walked_m / walked_m[-1])


def knobs() -> dict[str, Any]:
    """The rows without correction on the knobs' seeds, by value of stride_error_sd."""
    scene = Scene.read(SCENES[0])
    first, last = scene.walks["knob_seeds"]
    crews = [Crew(scene, seed) for seed in range(first, last + 1)]
    rows = {}
    for value in KNOB_VALUES:
        turn_ways = [crew.walk("turn_way_m", value) for crew in crews]
        turn, route = (
            [[follow(Reset(walk, None), walk) for walk in walks] for walks in ways]
            for ways in (turn_ways, [crew.walk("route_way_m", value) for crew in crews])
        )
        rows[f"{value:g}"] = _per_person("before", turn, turn_ways, route)
    return rows


def main() -> None:
    """Print figures as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--knobs", action="store_true", help="fit, on the knobs' seeds")
    print(json.dumps(knobs() if parser.parse_args().knobs else paper_b(), indent=2))


if __name__ == "__main__":
    main()
