"""Labelled windows of simulated walks: drawn people with drawn devices on routes of straight legs, turns and pauses."""

import math
from collections.abc import Iterator

import numpy as np

from mine_loc_bringup.activity.windows import windows_of
from mine_loc_core.stamps import NS_PER_S
from mine_loc_pdr.activity import ActivityKind
from mine_loc_pdr.activity_labels import LabelledWindow, decidable, label
from mine_loc_pdr.activity_window import WINDOW_NS
from mine_loc_sim.gait import draw_person
from mine_loc_sim.imu_errors import FLU_TO_FRD, Imu, draw_device
from mine_loc_sim.magnetic_field import GalleryField
from mine_loc_sim.route import Route, WayPoint, plan_route
from mine_loc_sim.walker import Walker

TURN_RAD = (math.radians(45.0), math.radians(135.0))
_RATE_HZ = 100.0
_LEG_M = (4.0, 20.0)
_FIRST_PAUSE_S = 5.0
_PAUSE_S = (5.0, 10.0)
_PAUSE_SHARE = 0.15  # of the corners


def simulated_windows(seed: int, walked_s: float) -> Iterator[LabelledWindow]:
    """Every window of the walk of person `seed`, about so long; place 0 is the first."""
    rng = np.random.default_rng(seed)
    person = draw_person(rng)
    walker = Walker(person, _route(rng, person.preferred_speed_m_s, walked_s), rng)
    imu = Imu(draw_device(rng), _RATE_HZ, rng)
    stamps_ns = imu.stamps_ns(0, round(walker.duration_s * NS_PER_S))
    motion = walker.motion(stamps_ns)
    samples = imu.sample(motion, GalleryField(rng).at(motion.position_m))
    rate, force = (each.astype(np.float64) * FLU_TO_FRD for each in (samples.gyro_rad_s, samples.accel_m_s2))
    strikes_ns = np.array([step.stamp_ns for step in walker.steps()])
    for place, window in enumerate(windows_of(stamps_ns, rate, force)):
        span_ns = (window.end_ns - WINDOW_NS, window.end_ns)
        first, last = np.searchsorted(stamps_ns, span_ns)
        turned_rad = float(np.ptp(motion.heading_rad[first:last]))
        steps = int(np.diff(np.searchsorted(strikes_ns, span_ns))[0])
        kind = label(turned_rad, steps)
        sure = kind == ActivityKind.STANDING or decidable(turned_rad)
        yield LabelledWindow(f"simulated {seed}", str(seed), place, window, kind, sure)


def _route(rng: np.random.Generator, speed_m_s: float, walked_s: float) -> Route:
    """Straight legs, a turn to either side between two of them, at some a pause."""
    points = [WayPoint((0.0, 0.0, 0.0), pause_s=_FIRST_PAUSE_S)]
    course_rad, x_m, y_m, left_m = rng.uniform(-math.pi, math.pi), 0.0, 0.0, walked_s * speed_m_s
    while left_m > 0.0:
        leg_m = rng.uniform(*_LEG_M)
        x_m, y_m, left_m = x_m + leg_m * math.cos(course_rad), y_m + leg_m * math.sin(course_rad), left_m - leg_m
        pause_s = rng.uniform(*_PAUSE_S) if rng.random() < _PAUSE_SHARE else 0.0
        points.append(WayPoint((x_m, y_m, 0.0), pause_s=pause_s))
        course_rad += rng.choice([-1.0, 1.0]) * rng.uniform(*TURN_RAD)
    return plan_route(points, speed_m_s)
