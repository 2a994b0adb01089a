"""Attitude of a worn IMU: gyro integration by quaternion, held upright by gravity (paper B, equations 4 to 6).

Scalars instead of arrays: this runs for every sample of every person, and on four numbers numpy is several times
slower.
"""

import math
from typing import TypeAlias

from numba import njit

from mine_loc_pdr.steps import Motion

Vector3: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]

STANDARD_GRAVITY_M_S2 = 9.80665
# Slow enough that the accelerations of a stride, which average to nothing, stay out; fast enough to hold the tilt
# against the drift of a gyro with 0.5 °/s of bias within 3°.
GRAVITY_TIME_CONSTANT_S = 5.0
_SMALLEST_FORWARD = 0.3  # horizontal part of a unit vector
_LARGEST_FORCE_M_S2 = 3.0 * STANDARD_GRAVITY_M_S2  # a knock against the device must not tip the horizon


class AttitudeFilter:
    """Attitude of the IMU in an odom frame: z up, and x where the person faced at the start.

    The tilt the IMU has at the start is taken for its mounting, so a belt that sits askew does no harm: base_link is
    the body levelled, its x axis the horizontal part of `forward_imu`. Where that points up or down, because the
    stated mounting is wrong, facing is off by a constant, which the alignment of odom with the map takes up.

    Vectors are in the IMU's axes, forward-left-up by convention. `forward_imu` is the level front of the body in them,
    `start_imu` the attitude at the start, base_link←imu by what was supposed of the mounting.
    """

    def __init__(self, force_m_s2: Vector3, forward_imu: Vector3 = (1.0, 0.0, 0.0)) -> None:
        """Start upright by gravity, from a specific force averaged over a moment; raises ValueError if it is zero."""
        self._q = _levelling(force_m_s2)
        self.forward_imu = forward_imu
        east, north = self.facing
        if math.hypot(east, north) > _SMALLEST_FORWARD:
            self._q = turned_about_up(self._q, -math.atan2(north, east))
        self.forward_imu = _row_x(self._q)
        self.start_imu = self._q
        self.bias_rad_s: Vector3 = (0.0, 0.0, 0.0)
        self.motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))  # compiled before samples are waiting

    def update(self, dt_s: float, rate_rad_s: Vector3, force_m_s2: Vector3) -> None:
        """Advance by dt_s with the mean angular rate over it and the specific force at its end."""
        fx, fy, fz = force_m_s2
        ux, uy, uz = self.up_imu
        gain = 1.0 / (GRAVITY_TIME_CONSTANT_S * STANDARD_GRAVITY_M_S2)
        magnitude = math.sqrt(fx * fx + fy * fy + fz * fz)
        if magnitude > _LARGEST_FORCE_M_S2:
            gain *= _LARGEST_FORCE_M_S2 / magnitude
        bx, by, bz = self.bias_rad_s
        self._q = turned(
            self._q,
            (rate_rad_s[0] - bx + gain * (fy * uz - fz * uy)) * dt_s,
            (rate_rad_s[1] - by + gain * (fz * ux - fx * uz)) * dt_s,
            (rate_rad_s[2] - bz + gain * (fx * uy - fy * ux)) * dt_s,
        )

    def correct(self, heading_rad: float, bias_rad_s: float) -> None:
        """Add to the heading, and to the gyro's bias about the vertical."""
        ux, uy, uz = self.up_imu
        bx, by, bz = self.bias_rad_s
        self.bias_rad_s = (bx + bias_rad_s * ux, by + bias_rad_s * uy, bz + bias_rad_s * uz)
        self._q = turned_about_up(self._q, heading_rad)

    def motion(self, rate_rad_s: Vector3, force_m_s2: Vector3) -> Motion:
        """Acceleration without gravity and turn rate without bias, upwards and along the waist's level directions."""
        return _level_motion(self._q, self.forward_imu, self.bias_rad_s, rate_rad_s, force_m_s2)

    @property
    def orientation_imu(self) -> Quaternion:
        """odom←imu, unit, w x y z."""
        return self._q

    @property
    def up_imu(self) -> Vector3:
        """Unit vector up, in the IMU's axes."""
        w, x, y, z = self._q
        return 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)

    @property
    def facing(self) -> tuple[float, float]:
        """Where base_link's x axis points, as east-like and north-like components in odom."""
        x, y, _ = rotated(self._q, self.forward_imu)
        return x, y

    @property
    def heading_rad(self) -> float:
        """Yaw of base_link in odom, -π..π, counter-clockwise."""
        x, y = self.facing
        return math.atan2(y, x)


def rotated(q: Quaternion, v: Vector3) -> Vector3:
    """The coordinates in A of a vector in B, where `q` is A←B."""
    w, x, y, z = q
    vx, vy, vz = v
    return (
        (1.0 - 2.0 * (y * y + z * z)) * vx + 2.0 * (x * y - w * z) * vy + 2.0 * (x * z + w * y) * vz,
        2.0 * (x * y + w * z) * vx + (1.0 - 2.0 * (x * x + z * z)) * vy + 2.0 * (y * z - w * x) * vz,
        2.0 * (x * z - w * y) * vx + 2.0 * (y * z + w * x) * vy + (1.0 - 2.0 * (x * x + y * y)) * vz,
    )


def turned(q: Quaternion, vx: float, vy: float, vz: float) -> Quaternion:
    """`q` turned by a rotation vector (rad) in the body's axes: paper B equation 4, exact for a constant rate."""
    angle = math.sqrt(vx * vx + vy * vy + vz * vz)
    s = math.sin(0.5 * angle) / angle if angle > 1e-9 else 0.5
    c, vx, vy, vz = math.cos(0.5 * angle), s * vx, s * vy, s * vz
    w, x, y, z = q
    w, x, y, z = (
        w * c - x * vx - y * vy - z * vz,
        w * vx + x * c + y * vz - z * vy,
        w * vy - x * vz + y * c + z * vx,
        w * vz + x * vy - y * vx + z * c,
    )
    n = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    return w * n, x * n, y * n, z * n


@njit(cache=True)
def _level_motion(
    q: Quaternion, forward_imu: Vector3, bias_rad_s: Vector3, rate_rad_s: Vector3, force_m_s2: Vector3
) -> Motion:
    """Compiled: in Python it took as long as the network takes to see a step in it."""
    w, x, y, z = q
    ux, uy, uz = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
    ax, ay, az = forward_imu
    rise = ax * ux + ay * uy + az * uz
    ax, ay, az = ax - rise * ux, ay - rise * uy, az - rise * uz
    norm = math.sqrt(ax * ax + ay * ay + az * az)
    if norm > 0.0:
        ax, ay, az = ax / norm, ay / norm, az / norm
    lx, ly, lz = uy * az - uz * ay, uz * ax - ux * az, ux * ay - uy * ax
    fx, fy, fz = force_m_s2
    rx, ry, rz = rate_rad_s[0] - bias_rad_s[0], rate_rad_s[1] - bias_rad_s[1], rate_rad_s[2] - bias_rad_s[2]
    return (
        ux * fx + uy * fy + uz * fz - STANDARD_GRAVITY_M_S2,
        ax * fx + ay * fy + az * fz,
        lx * fx + ly * fy + lz * fz,
        ux * rx + uy * ry + uz * rz,
        ax * rx + ay * ry + az * rz,
        lx * rx + ly * ry + lz * rz,
    )


def _levelling(force: Vector3) -> Quaternion:
    """The shortest rotation that turns `force` upwards."""
    magnitude = math.sqrt(sum(f * f for f in force))
    if not magnitude > 0.0:
        raise ValueError(f"specific force {force}: gravity cannot be told from it")
    x, y, z = (f / magnitude for f in force)
    if z < -1.0 + 1e-9:
        return 0.0, 1.0, 0.0, 0.0  # upside down: roll over
    n = math.sqrt(2.0 * (1.0 + z))
    return 0.5 * n, y / n, -x / n, 0.0


def turned_about_up(q: Quaternion, angle_rad: float) -> Quaternion:
    """`q` turned about odom's z axis, counter-clockwise."""
    c, s = math.cos(0.5 * angle_rad), math.sin(0.5 * angle_rad)
    w, x, y, z = q
    return c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w


def _row_x(q: Quaternion) -> Vector3:
    """The odom x axis in the IMU's axes."""
    w, x, y, z = q
    return 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
