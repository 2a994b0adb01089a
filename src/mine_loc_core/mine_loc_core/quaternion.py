"""Unit quaternions as arrays (..., 4) ordered w, x, y, z, Hamilton product; every function broadcasts.

`q` with frames A←B turns the coordinates of a vector in B into those in A, so `product(a_from_b, b_from_c)` is
a_from_c. Formulae: Solà, "Quaternion kinematics for the error-state Kalman filter", arXiv 1711.02508, sections 1-2.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def product(a: ArrayLike, b: ArrayLike) -> Array:
    """Hamilton product a ⊗ b, (..., 4)."""
    aw, ax, ay, az = _components(a)
    bw, bx, by, bz = _components(b)
    return np.stack(
        np.broadcast_arrays(
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ),
        axis=-1,
    )


def conjugate(q: ArrayLike) -> Array:
    """The inverse rotation of unit quaternions, (..., 4)."""
    return np.asarray(q, dtype=np.float64) * (1.0, -1.0, -1.0, -1.0)


def normalise(q: ArrayLike) -> Array:
    """Quaternions of length one, (..., 4)."""
    q = np.asarray(q, dtype=np.float64)
    unit: Array = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return unit


def rotate(q: ArrayLike, v: ArrayLike) -> Array:
    """Vectors v (..., 3) turned by unit quaternions q (..., 4)."""
    q, v = np.asarray(q, dtype=np.float64), np.asarray(v, dtype=np.float64)
    twice = 2.0 * np.cross(q[..., 1:], v)
    return v + q[..., :1] * twice + np.cross(q[..., 1:], twice)


def from_rotation_vector(v: ArrayLike) -> Array:
    """Exponential map: axis times angle in rad (..., 3) to unit quaternions (..., 4)."""
    v = np.asarray(v, dtype=np.float64)
    half = 0.5 * np.linalg.norm(v, axis=-1, keepdims=True)
    return np.concatenate((np.cos(half), 0.5 * v * np.sinc(half / np.pi)), axis=-1)


def from_euler_zyx(roll: ArrayLike, pitch: ArrayLike, yaw: ArrayLike) -> Array:
    """Yaw about z, then pitch about the new y, then roll about the new x (rad) to (..., 4).

    The same as roll, pitch, yaw about the fixed axes (REP 103).
    """
    half = [0.5 * np.asarray(angle, dtype=np.float64) for angle in (roll, pitch, yaw)]
    (cr, cp, cy), (sr, sp, sy) = (np.cos(half[0]), np.cos(half[1]), np.cos(half[2])), [np.sin(angle) for angle in half]
    return np.stack(
        np.broadcast_arrays(
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ),
        axis=-1,
    )


def to_euler_zyx(q: ArrayLike) -> tuple[Array, Array, Array]:
    """Roll and yaw in -π..π, pitch in -π/2..π/2 (rad) of unit quaternions; inverse of from_euler_zyx.

    At a pitch of ±π/2 only yaw ∓ roll is defined; the split returned there is one of many.
    """
    w, x, y, z = _components(q)
    roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return roll, pitch, yaw


def _components(q: ArrayLike) -> tuple[Array, Array, Array, Array]:
    q = np.asarray(q, dtype=np.float64)
    return q[..., 0], q[..., 1], q[..., 2], q[..., 3]
