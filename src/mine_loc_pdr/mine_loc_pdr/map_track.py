"""A person's dead reckoning in the map, corrected by marked turns and, where the site has them, by its galleries.

Paper B resets the position at a marker and keeps the heading and the step length that led astray. Here a Kalman filter
carries what makes the error grow along with the position: the yaw of odom in the map, its drift, and the scale of the
steps. A marker then corrects all of them, since their errors are correlated with that of the position.

State: x, y (m, map), yaw of odom in the map (rad), its rate (rad/s), step scale (1). odom itself is not touched
(REP 105): this is a track of its own in the map.
"""

import math
from collections import Counter, deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.stamps import NS_PER_S, to_s
from mine_loc_pdr.dead_reckoning import DIRECTION_SD_RAD, MISSED_STEP_SHARE, StepEvent
from mine_loc_pdr.drift import (
    BIAS_WALK_RAD_S_SQRT_S,
    RATE_NOISE_RAD_SQRT_S,
    SCALE_FACTOR_SD,
    TURNING_RATE_RAD_S,
    WALKING_SPEED_M_S,
)
from mine_loc_pdr.gallery_constraint import GalleryConstraint
from mine_loc_pdr.pseudo_plane import MARKER_SD_M, LandmarkFix, PseudoPlane, Verdict
from mine_loc_pdr.stride import STEP_TO_STEP_SD_M
from mine_loc_pdr.turn_corner import corner_of
from mine_loc_pdr.turns import Turn

Array = NDArray[np.float64]

X, Y, YAW, RATE, SCALE = range(5)
HISTORY_NS = 10 * NS_PER_S  # longer than the longest turn and its report
LONGEST_STEP_M = 2.0
MISSED_STRAIGHT_SHARE = 0.01  # measured: steps of straight walking in ipol_gait_lowerback (docs/pdr.md)
# Assumed: who turns so far between two steps may have made the second on the spot or in full. In between, its length
# lies evenly between the share that is left and the whole.
ON_THE_SPOT_RAD = math.pi / 2
SWAY_RAD = math.radians(10.0)  # between two steps of a straight walk, at most
STRAIGHT_RAD = math.radians(20.0)  # between two steps, at most, for both to count as straight on
LEAST_STRAIGHT_M = 2.0  # before a gallery is taken to lead the person
BEFORE_TURN_NS = 3 * NS_PER_S  # who turns at a marker has walked there


@dataclass(frozen=True, slots=True)
class MapPose:
    """Where a person is and faces in the map; covariance (3, 3) of x (m), y (m), yaw (rad)."""

    stamp_ns: int
    x_m: float
    y_m: float
    yaw_rad: float
    covariance: Array


class MapTrack:
    """Steps and turns of one person since a pose in the map was given.

    `faults` counts steps that were dropped (not_finite, too_long, duplicate, backward) and turns that were: standing,
    when the person had not walked there; forgotten, when it is too late to say where it was.
    """

    def __init__(
        self,
        start: MapPose,
        facing_rad: float,
        scale_variance: float,
        rate_sd_rad_s: float,
        plane: PseudoPlane,
        galleries: GalleryConstraint | None = None,
    ) -> None:
        """`facing_rad`: heading in odom at the start. `scale_variance` and `rate_sd_rad_s` are what dead reckoning
        claims for its step scale and for the drift of its heading.
        """
        self._plane, self._galleries = plane, galleries
        self._state = np.array([start.x_m, start.y_m, start.yaw_rad - facing_rad, 0.0, 1.0])
        self._covariance = np.zeros((5, 5))
        self._covariance[:3, :3] = start.covariance
        self._covariance[RATE, RATE] = rate_sd_rad_s**2
        self._covariance[SCALE, SCALE] = scale_variance
        self._start_ns = self._stamp_ns = start.stamp_ns
        self._heading_rad = facing_rad
        self._walked: deque[tuple[int, float, float]] = deque([(start.stamp_ns, 0.0, 0.0)])
        self._straight_m = 0.0
        self.faults: Counter[str] = Counter()

    def pose(self) -> MapPose:
        """After the last step."""
        x_m, y_m, yaw_rad = self._state[:3].tolist()
        heading_rad = math.remainder(yaw_rad + self._heading_rad, math.tau)
        return MapPose(self._stamp_ns, x_m, y_m, heading_rad, self._covariance[:3, :3].copy())

    def step(self, step: StepEvent) -> None:
        """Walk on by a step; one that is no step is counted and dropped."""
        if fault := self._fault(step):
            self.faults[fault] += 1
            return
        turned_rad = math.remainder(step.heading_rad - self._heading_rad, math.tau)
        self._pass_time(to_s(step.stamp_ns - self._stamp_ns), turned_rad)
        self._stamp_ns, self._heading_rad = step.stamp_ns, step.heading_rad
        self._move(step, abs(turned_rad))
        self._straight_m = self._straight_m + step.length_m if abs(turned_rad) <= STRAIGHT_RAD else 0.0
        if self._galleries is not None and self._straight_m >= LEAST_STRAIGHT_M:
            self._keep_to_gallery(self._galleries, step)

    def turn(self, turn: Turn) -> LandmarkFix | None:
        """Match a turn and, where a marker fits, correct the track by it; None if it is no turn of a marker."""
        corner = corner_of(turn, self._walked)
        if corner is None:
            self.faults["forgotten"] += 1
            return None
        since_ns = max(turn.begin_ns - BEFORE_TURN_NS, self._start_ns + 1)
        if not any(since_ns <= stamp_ns <= turn.end_ns for stamp_ns, _, _ in self._walked):
            self.faults["standing"] += 1
            return None
        place_m, design = self._place_before(corner.since)
        place_m -= self._in_map(corner.loop)
        fix = self._plane.match(turn, place_m, design @ self._covariance @ design.T)
        if fix is not None and fix.verdict is Verdict.MATCHED and fix.marker is not None:
            self._state[:2] -= self._in_map(corner.loop)
            self._correct(np.array(fix.marker.position_m[:2]) - place_m, design, MARKER_SD_M**2 * np.eye(2))
        return fix

    def gap(self, dt_s: float) -> None:
        """Nothing was measured for dt_s: the person may have walked and turned."""
        self._covariance[[X, Y, YAW], [X, Y, YAW]] += np.square(
            [WALKING_SPEED_M_S * dt_s, WALKING_SPEED_M_S * dt_s, TURNING_RATE_RAD_S * dt_s]
        )

    def _fault(self, step: StepEvent) -> str | None:
        if not all(map(math.isfinite, (step.heading_rad, step.length_m, step.confidence))):
            return "not_finite"
        if not 0.0 <= step.length_m <= LONGEST_STEP_M:
            return "too_long"
        if step.stamp_ns <= self._stamp_ns:
            return "backward" if step.stamp_ns < self._stamp_ns else "duplicate"
        return None

    def _pass_time(self, dt_s: float, turned_rad: float) -> None:
        """The rate turns the yaw; noise and the gyro's scale let it wander."""
        transition = np.eye(5)
        transition[YAW, RATE] = dt_s
        self._state[YAW] += self._state[RATE] * dt_s
        self._propagate(transition)
        self._covariance[YAW, YAW] += RATE_NOISE_RAD_SQRT_S**2 * dt_s + (SCALE_FACTOR_SD * turned_rad) ** 2
        self._covariance[RATE, RATE] += BIAS_WALK_RAD_S_SQRT_S**2 * dt_s

    def _move(self, step: StepEvent, turned_rad: float) -> None:
        on_the_spot = min(max(turned_rad - SWAY_RAD, 0.0) / ON_THE_SPOT_RAD, 1.0)
        length_m, scale = step.length_m * (1.0 - 0.5 * on_the_spot), self._state[SCALE]
        course_rad = step.heading_rad + self._state[YAW]
        ahead = np.array([math.cos(course_rad), math.sin(course_rad)])
        aside = np.array([-ahead[1], ahead[0]])
        self._state[:2] += scale * length_m * ahead
        transition = np.eye(5)
        transition[:2, YAW] = scale * length_m * aside
        transition[:2, SCALE] = length_m * ahead
        self._propagate(transition)
        missed = MISSED_STEP_SHARE if step.interval_s is None or on_the_spot > 0.0 else MISSED_STRAIGHT_SHARE
        along_m2 = STEP_TO_STEP_SD_M**2 + (missed + 1.0 - step.confidence) * step.length_m**2
        along_m2 += (on_the_spot * step.length_m) ** 2 / 12.0
        across_m2 = (length_m * DIRECTION_SD_RAD) ** 2
        self._covariance[:2, :2] += along_m2 * np.outer(ahead, ahead) + across_m2 * np.outer(aside, aside)
        self._remember(step.stamp_ns, length_m * math.cos(step.heading_rad), length_m * math.sin(step.heading_rad))

    def _remember(self, stamp_ns: int, dx_m: float, dy_m: float) -> None:
        """Keep the way in odom, without the scale."""
        _, x_m, y_m = self._walked[-1]
        self._walked.append((stamp_ns, x_m + dx_m, y_m + dy_m))
        while self._walked[0][0] < stamp_ns - HISTORY_NS:
            self._walked.popleft()

    def _keep_to_gallery(self, galleries: GalleryConstraint, step: StepEvent) -> None:
        sd_m = math.sqrt(float(np.linalg.eigvalsh(self._covariance[:2, :2])[1]))
        guidance = galleries.guide(self._state[:2], sd_m, step.heading_rad + self._state[YAW], step.length_m)
        if guidance is None:
            return
        design = np.zeros((2, 5))
        design[0, :2] = guidance.left
        design[1, YAW] = 1.0
        off = np.array([guidance.across_m, guidance.course_off_rad])
        self._correct(-off, design, np.diag([guidance.across_variance_m2, guidance.course_variance_rad2]))

    def _in_map(self, way: Array) -> Array:
        """A way in odom, (2,), turned into the map and scaled."""
        c, s = math.cos(self._state[YAW]), math.sin(self._state[YAW])
        scaled: Array = self._state[SCALE] * np.array([c * way[0] - s * way[1], s * way[0] + c * way[1]])
        return scaled

    def _place_before(self, since: Array) -> tuple[Array, Array]:
        """Where the person was before walking `since`, (2,), and its derivative by the state, (2, 5)."""
        way = self._in_map(since)
        design = np.eye(2, 5)
        design[:, YAW] = way[1], -way[0]
        design[:, SCALE] = -way / self._state[SCALE]
        return self._state[:2] - way, design

    def _correct(self, innovation: Array, design: Array, noise: Array) -> None:
        """Kalman update in Joseph form."""
        spread = design @ self._covariance @ design.T + noise
        gain = np.linalg.solve(spread, design @ self._covariance).T
        self._state += gain @ innovation
        keep = np.eye(5) - gain @ design
        covariance = keep @ self._covariance @ keep.T + gain @ noise @ gain.T
        self._covariance = 0.5 * (covariance + covariance.T)

    def _propagate(self, transition: Array) -> None:
        moved = transition @ self._covariance @ transition.T
        self._covariance = 0.5 * (moved + moved.T)
