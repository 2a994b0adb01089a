"""True motion of a waist that sways about a path: position, attitude, and what an ideal IMU there measures.

Frames: ENU map, FLU body (REP 103); quaternions w, x, y, z, body to map.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mine_loc_sim import gait_constants as gc
from mine_loc_sim.gait import Sway
from mine_loc_sim.route import Pose

Array = npt.NDArray[np.float64]
StampArray = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class WaistMotion:
    """Truth at n instants: position and derivatives in the map (n, 3), attitude (n, 4), rate and force in the body."""

    stamp_ns: StampArray
    position_m: Array
    velocity_m_s: Array
    acceleration_m_s2: Array
    orientation_wxyz: Array
    heading_rad: Array
    angular_rate_rad_s: Array
    specific_force_m_s2: Array


def compose(stamp_ns: StampArray, path: Pose, sway: Sway, waist_height_m: float) -> WaistMotion:
    """Put the waist's motion in the heading frame onto the path, with derivatives (horizontal as complex numbers)."""
    turn = np.exp(1j * path.heading_rad)
    h1, h2 = path.turn_rate_rad_s, path.turn_acceleration_rad_s2
    d, d1, d2 = (x[:, 0] + 1j * x[:, 1] for x in (sway.value, sway.rate, sway.acceleration))
    horizontal = (turn * d, turn * (d1 + 1j * h1 * d), turn * (d2 + 2j * h1 * d1 + (1j * h2 - h1**2) * d))
    position, velocity, acceleration = (
        base + np.column_stack([z.real, z.imag, moved[:, 2]])
        for base, z, moved in zip(
            (path.position_m, path.velocity_m_s, path.acceleration_m_s2),
            horizontal,
            (sway.value, sway.rate, sway.acceleration),
            strict=True,
        )
    )
    position[:, 2] += waist_height_m
    angles = sway.value[:, 3:] + np.outer(path.heading_rad, [0.0, 0.0, 1.0])
    rates = sway.rate[:, 3:] + np.outer(h1, [0.0, 0.0, 1.0])
    force = acceleration + np.array([0.0, 0.0, gc.GRAVITY_M_S2])
    orientation, force_body, rate_body = _in_body(angles, rates, force)
    return WaistMotion(stamp_ns, position, velocity, acceleration, orientation, path.heading_rad, rate_body, force_body)


def _in_body(angles: Array, rates: Array, vector: Array) -> tuple[Array, Array, Array]:
    """Quaternion, a map vector in the body and the body's angular rate, of roll, pitch, yaw (Diebel 2006)."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles / 2).T, np.cos(angles / 2).T
    orientation = np.column_stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles).T, np.cos(angles).T
    x, y, z = vector.T
    x, y = cy * x + sy * y, cy * y - sy * x
    x, z = cp * x - sp * z, sp * x + cp * z
    y, z = cr * y + sr * z, cr * z - sr * y
    roll_rate, pitch_rate, yaw_rate = rates.T
    rate = [roll_rate - yaw_rate * sp, pitch_rate * cr + yaw_rate * cp * sr, -pitch_rate * sr + yaw_rate * cp * cr]
    return orientation, np.column_stack([x, y, z]), np.column_stack(rate)
