"""One person on a route: true motion of the waist at any instant, and the steps and turns that made it.

The waist's trajectory is one analytic curve: the route at a route time that the steps pace, plus the periodic and
irregular motion of gait. Velocity, acceleration, attitude and angular rate are its exact derivatives, so an ideal IMU
integrates back to it. Frames: ENU map, FLU body (REP 103); quaternions w, x, y, z, body to map.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from mine_loc_core.stamps import NS_PER_S, to_ns
from mine_loc_sim import gait_constants as gc
from mine_loc_sim.gait import IrregularMotion, Person, control_instants_s, periodic_motion
from mine_loc_sim.route import Pose, Route
from mine_loc_sim.waist_motion import StampArray, WaistMotion, compose

Array = npt.NDArray[np.float64]
CADENCE_GRID_S = 0.05


@dataclass(frozen=True, slots=True)
class TrueStep:
    """A heel strike that ends a step: distance and heading of the path since the strike before."""

    stamp_ns: int
    foot: str
    length_m: float
    heading_rad: float
    position_m: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class TrueTurn:
    """A turn: instants at which 5 % and 95 % of the angle (counter-clockwise positive) were done."""

    start_ns: int
    stop_ns: int
    angle_rad: float


class Walker:
    """A person walking a route from `start_ns` on; everything follows from the arguments and the generator's state."""

    def __init__(self, person: Person, route: Route, rng: np.random.Generator, start_ns: int = 0) -> None:
        self.person = person
        self.start_ns = start_ns
        self._route = route
        pacing, gait, fast, slow = rng.spawn(4)
        strike_s, route_s = _pace(person, route, pacing)
        self.duration_s = float(np.interp(route.duration_s, route_s, strike_s))
        self._strike_s = strike_s
        self._route_time = CubicSpline(strike_s, route_s)
        self._phase = CubicSpline(strike_s, np.pi * np.arange(len(strike_s)))
        effort = _effort_m_s(route.at(self._route_time(strike_s)))
        self._gain = CubicSpline(strike_s, _gains(person, effort, gait), bc_type="clamped")
        relative = effort / gc.REFERENCE_SPEED_M_S
        self._irregular = (
            _irregular(fast, gc.IRREGULARITY_PEAK_HZ, strike_s, np.outer(relative, gc.WALK_IRREGULARITY)),
            _irregular(
                slow, gc.WANDER_PEAK_HZ, strike_s, np.hypot(np.outer(relative, gc.WALK_WANDER), gc.STANDING_SWAY)
            ),
        )

    def motion(self, stamp_ns: StampArray) -> WaistMotion:
        """True motion of the waist at integer-nanosecond stamps (n,); motionless before the start and after the end.

        A pure function of the stamps; how they are cut into blocks changes results by rounding only.
        """
        t_s = (stamp_ns - self.start_ns) / NS_PER_S
        t = np.clip(t_s, self._strike_s[0], self._strike_s[-1])
        path = self._path(t)
        sway = periodic_motion(
            self.person.harmonics,
            (self._phase(t), self._phase(t, 1), self._phase(t, 2)),
            (self._gain(t), self._gain(t, 1), self._gain(t, 2)),
        )
        for irregular in self._irregular:
            sway += irregular.at(t_s)
        return compose(stamp_ns, path, sway, self.person.waist_height_m)

    def _path(self, t: Array) -> Pose:
        """The route paced by the steps: chain rule through route time."""
        tau, rate, bend = (self._route_time(t, d) for d in range(3))
        pose = self._route.at(tau)
        return Pose(
            pose.position_m,
            pose.velocity_m_s * rate[:, None],
            pose.acceleration_m_s2 * rate[:, None] ** 2 + pose.velocity_m_s * bend[:, None],
            pose.heading_rad,
            pose.turn_rate_rad_s * rate,
            pose.turn_acceleration_rad_s2 * rate**2 + pose.turn_rate_rad_s * bend,
        )

    def steps(self) -> tuple[TrueStep, ...]:
        """All steps in order; a strike that neither moved nor turned the person is standing, not a step."""
        pose = self._route.at(self._route_time(self._strike_s))
        moved = np.linalg.norm(np.diff(pose.position_m, axis=0), axis=1)
        turned = np.abs(np.diff(pose.heading_rad))
        made = (moved >= gc.LEAST_STEP_M) | (turned >= gc.LEAST_STEP_TURN_RAD)
        return tuple(
            TrueStep(
                stamp_ns=self.start_ns + to_ns(float(self._strike_s[i])),
                foot="left" if i % 2 == 0 else "right",
                length_m=float(moved[i - 1]),
                heading_rad=float(pose.heading_rad[i]),
                position_m=(float(pose.position_m[i, 0]), float(pose.position_m[i, 1]), float(pose.position_m[i, 2])),
            )
            for i in np.flatnonzero(made) + 1
        )

    def turns(self) -> tuple[TrueTurn, ...]:
        """All turns of the route as walked."""
        found = []
        for turn in self._route.turns:
            tau = turn.middle_s + np.arange(-0.5, 0.5, 0.002) * (turn.duration_s + 6 * gc.ROUTE_SPACING_S)
            done = np.cumsum(self._route.at(tau).turn_rate_rad_s) * (tau[1] - tau[0]) / turn.angle_rad
            ends = np.interp([0.05, 0.95], np.maximum.accumulate(done), tau)
            start, stop = np.interp(ends, self._route_time(self._strike_s), self._strike_s)
            found.append(TrueTurn(self.start_ns + to_ns(start), self.start_ns + to_ns(stop), turn.angle_rad))
        return tuple(found)


def _effort_m_s(pose: Pose) -> Array:
    """Speed of the feet: of the body and, when turning, about it."""
    effort: Array = np.hypot(np.linalg.norm(pose.velocity_m_s, axis=1), gc.TURN_FOOT_RADIUS_M * pose.turn_rate_rad_s)
    return effort


def _pace(person: Person, route: Route, rng: np.random.Generator) -> tuple[Array, Array]:
    """Heel-strike times and the route time at each: cadence by the law, with its scatter, from before the start on.

    A standing person's phase keeps running, with no motion: the first step then starts anywhere in the cycle.
    """
    grid = np.arange(0.0, route.duration_s + CADENCE_GRID_S, CADENCE_GRID_S)
    cadence = person.law.frequency_hz(_effort_m_s(route.at(grid)))
    relative_slope = person.law.slope_m_s * person.law.stride_factor / person.law.length_m(cadence)
    t, tau, n = -1.0, -1.0, 0
    strikes, route_times = [t], [tau]
    while tau < route.duration_s + 2.0:
        i = min(max(int(tau / CADENCE_GRID_S), 0), len(grid) - 1)
        jitter, residual = np.clip(rng.standard_normal(2), -3.0, 3.0)
        frequency = cadence[i]
        stretch = 1.0 + person.step_time_cv * jitter
        length = 1.0 + relative_slope[i] * frequency * (1.0 / stretch - 1.0) + person.step_length_cv * residual
        n += 1
        limp = person.step_time_asymmetry / 2 * (1 if n % 2 == 0 else -1)
        t += (stretch + limp) / frequency
        tau += length / frequency
        strikes.append(t)
        route_times.append(tau)
    return np.array(strikes), np.array(route_times)


def _gains(person: Person, effort_m_s: Array, rng: np.random.Generator) -> Array:
    """Gain of each channel's series at each strike, (n, 6): by speed and cadence, with step-to-step scatter."""
    relative = effort_m_s / gc.REFERENCE_SPEED_M_S
    cadence = person.law.frequency_hz(effort_m_s) / person.reference_frequency_hz
    fade = np.minimum(relative / gc.FULL_GAIT_SPEED_SHARE, 1.0)[:, None]
    gains: Array = fade * relative[:, None] ** np.array(gc.SPEED_EXPONENT)
    gains[:, :3] /= cadence[:, None] ** 2  # of acceleration → of displacement
    gains[:, 3:] /= cadence[:, None]  # of rate → of angle
    gains *= 1.0 + np.array(gc.STEP_GAIN_SD) * rng.standard_normal(gains.shape)
    return gains


def _irregular(rng: np.random.Generator, peak_hz: float, strike_s: Array, deviation: Array) -> IrregularMotion:
    """Irregular motion whose deviation (n, 6) is given at the strikes."""
    instants = control_instants_s(peak_hz, float(strike_s[-1]))
    at_controls = [np.interp(instants, strike_s, column) for column in deviation.T]
    return IrregularMotion(rng, peak_hz, np.stack(at_controls, axis=1))
