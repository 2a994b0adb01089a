"""A route along galleries as a pose over time: way-points, speeds, pauses and turns made smooth.

Between way-points the walker keeps to the straight line; corners are slowed down for and rounded, reversals are turned
on the spot. Position and heading are B-splines of time, so speed, turn rate and their derivatives are continuous.
Frames: ENU map, heading from east counter-clockwise (REP 103).
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mine_loc_core.errors import ConfigurationError
from mine_loc_core.stamps import NS_PER_S
from mine_loc_sim import gait_constants as gc
from mine_loc_sim.smooth_curve import SmoothCurve

Array = npt.NDArray[np.float64]
MIN_LEG_M = 0.05


@dataclass(frozen=True, slots=True)
class WayPoint:
    """A place on the route: ENU position on the ground, what to do there and how fast to go on.

    `speed_m_s` None means the walker's own preferred speed; `face_rad` is a heading to turn to while pausing.
    """

    position_m: tuple[float, float, float]
    speed_m_s: float | None = None
    pause_s: float = 0.0
    face_rad: float | None = None


@dataclass(frozen=True, slots=True)
class Pose:
    """Where a route is at n instants: ground position (n, 3) m, heading (n,) rad, and their first two derivatives."""

    position_m: Array
    velocity_m_s: Array
    acceleration_m_s2: Array
    heading_rad: Array
    turn_rate_rad_s: Array
    turn_acceleration_rad_s2: Array


@dataclass(frozen=True, slots=True)
class PlannedTurn:
    """A change of heading: its nominal middle and length in route time, and its angle (counter-clockwise positive)."""

    middle_s: float
    duration_s: float
    angle_rad: float


class Route:
    """A planned route; route time starts at 0 with the first pause."""

    def __init__(self, curve: SmoothCurve, duration_s: float, turns: tuple[PlannedTurn, ...]) -> None:
        self._curve = curve
        self.duration_s = duration_s
        self.turns = turns

    def at(self, route_s: Array) -> Pose:
        """Pose at route times (n,) in s; standing still before the start and after the end."""
        p, v, a = (self._curve(route_s, d) for d in range(3))
        return Pose(p[:, :3], v[:, :3], a[:, :3], p[:, 3], v[:, 3], a[:, 3])

    def at_stamps(self, stamp_ns: npt.NDArray[np.int64], start_ns: int = 0) -> Pose:
        """Pose at integer-nanosecond instants (n,) of a route that starts at `start_ns`."""
        return self.at((stamp_ns - start_ns) / NS_PER_S)


def plan_route(way_points: Sequence[WayPoint], preferred_speed_m_s: float = gc.PREFERRED_SPEED_M_S) -> Route:
    """Plan a route through `way_points`.

    Raises ConfigurationError when there are fewer than two, two in a row coincide, or a speed or pause is impossible.
    """
    _check(way_points, preferred_speed_m_s)
    points = np.array([w.position_m for w in way_points], dtype=np.float64)
    legs = np.diff(points, axis=0)
    lengths = np.linalg.norm(legs, axis=1)
    courses = np.arctan2(legs[:, 1], legs[:, 0])
    cruise = np.array([w.speed_m_s or preferred_speed_m_s for w in way_points[:-1]])
    corner = np.array([0.0, *(_wrapped(b - a) for a, b in itertools.pairwise(courses)), 0.0])
    nodes = _node_speeds(way_points, cruise, lengths, corner)
    times, distances, speeds, arrivals = _speed_profile(lengths, cruise, nodes, way_points)
    turns = _turns(way_points, courses, arrivals, preferred_speed_m_s)
    duration = times[-1]
    grid = np.arange(0.0, duration + gc.ROUTE_SPACING_S, gc.ROUTE_SPACING_S)
    along = _travelled(grid, times, distances, speeds)
    at_node = np.concatenate([[0.0], np.cumsum(lengths)])
    xyz = np.stack([np.interp(along, at_node, points[:, i]) for i in range(3)], axis=1)
    heading = courses[0] + sum(
        (t.angle_rad * _ease((grid - t.middle_s) / t.duration_s) for t in turns), np.zeros(len(grid))
    )
    return Route(SmoothCurve(0.0, gc.ROUTE_SPACING_S, np.column_stack([xyz, heading])), duration, turns)


def _check(way_points: Sequence[WayPoint], preferred_speed_m_s: float) -> None:
    if len(way_points) < 2:
        raise ConfigurationError(f"route: {len(way_points)} way-points, at least 2 are needed")
    if not preferred_speed_m_s > 0:
        raise ConfigurationError(f"route: preferred speed {preferred_speed_m_s} m/s, allowed: above 0")
    for i, w in enumerate(way_points):
        if w.speed_m_s is not None and not 0 < w.speed_m_s <= gc.MAX_SPEED_M_S:
            raise ConfigurationError(
                f"route: way-point {i}: speed {w.speed_m_s} m/s, allowed: above 0 to {gc.MAX_SPEED_M_S}"
            )
        if not w.pause_s >= 0:
            raise ConfigurationError(f"route: way-point {i}: pause {w.pause_s} s, allowed: 0 or more")
        if w.face_rad is not None and w.pause_s == 0:
            raise ConfigurationError(f"route: way-point {i}: face_rad needs a pause_s above 0")
    for i, (a, b) in enumerate(itertools.pairwise(way_points)):
        if not math.dist(a.position_m[:2], b.position_m[:2]) >= MIN_LEG_M:
            raise ConfigurationError(f"route: way-points {i} and {i + 1} are less than {MIN_LEG_M} m apart on the map")


def _wrapped(angle_rad: float) -> float:
    """The angle in (−π, π], with a reversal always to the left whatever the rounding."""
    angle = math.remainder(angle_rad, 2 * math.pi)
    return angle + 2 * math.pi if angle < -math.pi + 1e-9 else angle


def _node_speeds(way_points: Sequence[WayPoint], cruise: Array, lengths: Array, corner: Array) -> Array:
    """Speed at each way-point: 0 at ends and pauses, cos(half the turn) of cruise at corners, all reachable."""
    around = np.minimum(np.append(cruise, cruise[-1]), np.insert(cruise, 0, cruise[0]))
    speed: Array = around * np.maximum(np.cos(corner / 2), 0.0)
    speed[[0, -1]] = 0.0
    speed[[w.pause_s > 0 for w in way_points]] = 0.0
    for i in range(len(lengths)):
        speed[i + 1] = min(speed[i + 1], math.sqrt(speed[i] ** 2 + 2 * gc.SPEED_CHANGE_M_S2 * lengths[i]))
    for i in reversed(range(len(lengths))):
        speed[i] = min(speed[i], math.sqrt(speed[i + 1] ** 2 + 2 * gc.SPEED_CHANGE_M_S2 * lengths[i]))
    return speed


def _speed_profile(
    lengths: Array, cruise: Array, nodes: Array, way_points: Sequence[WayPoint]
) -> tuple[Array, Array, Array, list[float]]:
    """Breakpoints (time, distance, speed) between which the acceleration is constant, and arrival at each way-point."""
    a = gc.SPEED_CHANGE_M_S2
    times, distances, speeds, arrivals = [0.0], [0.0], [0.0], []

    def advance(duration: float, distance: float, speed: float) -> None:
        times.append(times[-1] + duration)
        distances.append(distances[-1] + distance)
        speeds.append(speed)

    for i, way_point in enumerate(way_points):
        arrivals.append(times[-1])
        advance(way_point.pause_s, 0.0, speeds[-1])
        if i == len(lengths):
            break
        v0, v1 = nodes[i], nodes[i + 1]
        top = min(max(cruise[i], v0, v1), math.sqrt((v0**2 + v1**2) / 2 + a * lengths[i]))
        up, down = (top**2 - v0**2) / (2 * a), (top**2 - v1**2) / (2 * a)
        level = max(lengths[i] - up - down, 0.0)
        advance((top - v0) / a, up, top)
        advance(level / top, level, top)
        advance((top - v1) / a, down, v1)
    return np.array(times), np.array(distances), np.array(speeds), arrivals


def _travelled(t_s: Array, times: Array, distances: Array, speeds: Array) -> Array:
    """Distance along the polyline at `t_s`: exact between breakpoints of constant acceleration."""
    i = np.clip(np.searchsorted(times, t_s, side="right") - 1, 0, len(times) - 2)
    span = np.maximum(times[i + 1] - times[i], 1e-12)
    dt = np.clip(t_s - times[i], 0.0, span)
    travelled: Array = distances[i] + speeds[i] * dt + (speeds[i + 1] - speeds[i]) / span * dt**2 / 2
    return travelled


def turn_duration_s(angle_rad: float, preferred_speed_m_s: float) -> float:
    """Nominal length of a turn, before smoothing; longer for larger angles and for slower people."""
    share = gc.TURN_BASE_SHARE + (1 - gc.TURN_BASE_SHARE) * abs(angle_rad) / math.pi
    return gc.U_TURN_S * share * gc.PREFERRED_SPEED_M_S / preferred_speed_m_s


def _turns(
    way_points: Sequence[WayPoint], courses: Array, arrivals: Sequence[float], preferred_speed_m_s: float
) -> tuple[PlannedTurn, ...]:
    """The turn at each way-point: onto the next leg, or first to `face_rad` and then onto the next leg."""
    turns = []
    heading = courses[0]
    for i, way_point in enumerate(way_points):
        if way_point.face_rad is not None:
            angle = _wrapped(way_point.face_rad - heading)
            duration = turn_duration_s(angle, preferred_speed_m_s)
            turns.append(PlannedTurn(arrivals[i] + duration / 2, duration, angle))
            heading += angle
        angle = _wrapped(courses[i] - heading) if i < len(courses) else 0.0
        if abs(angle) > 1e-9:
            turns.append(
                PlannedTurn(arrivals[i] + way_point.pause_s, turn_duration_s(angle, preferred_speed_m_s), angle)
            )
            heading += angle
    return tuple(turns)


def _ease(u: Array) -> Array:
    """Minimum-jerk rise from 0 at u = −½ to 1 at u = +½ (Flash and Hogan 1985)."""
    x = np.clip(u + 0.5, 0.0, 1.0)
    eased: Array = x**3 * (10 - 15 * x + 6 * x**2)
    return eased
