"""What anchors make of a position: distances, the dilution of precision, and the small linear algebra of fixes.

Compiled, because a tracker asks for it with every range; LAPACK's overhead is many times a 3 x 3 solution.
"""

import math

import numpy as np
from numba import njit

from mine_loc_uwb.fix import Array

_SINGULAR = 1e-12
_NEAREST_M = 1e-6


@njit(cache=True)
def solve_symmetric(A: Array, b: Array) -> bool:
    """Solve A x = b by Cholesky for small positive definite A (d, d); x is left in `b`, the factor in A's lower half.

    False, with `b` unchanged, when A is not safely positive definite.
    """
    if not _factor(A):
        return False
    size = len(b)
    for i in range(size):
        for k in range(i):
            b[i] -= A[i, k] * b[k]
        b[i] /= A[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            b[i] -= A[k, i] * b[k]
        b[i] /= A[i, i]
    return True


@njit(cache=True)
def _factor(A: Array) -> bool:
    """Cholesky's factor of A into its lower half; False when a pivot is nothing beside A's largest entry."""
    least = _SINGULAR * np.max(np.abs(A))
    for j in range(len(A)):
        for k in range(j):
            A[j, j] -= A[j, k] * A[j, k]
        if not A[j, j] > least:
            return False
        A[j, j] = math.sqrt(A[j, j])
        for i in range(j + 1, len(A)):
            for k in range(j):
                A[i, j] -= A[i, k] * A[j, k]
            A[i, j] /= A[j, j]
    return True


@njit(cache=True)
def direction(position: Array, anchor: Array, height_m: float, unit: Array) -> float:
    """Distance from an anchor (3,) to a position (d,), and in `unit` (d,) its gradient.

    With d = 2 the position is at `height_m`, so the distance is slant and the gradient shorter than 1.
    """
    square = 0.0 if len(position) == 3 else (height_m - anchor[2]) ** 2
    for axis in range(len(position)):
        unit[axis] = position[axis] - anchor[axis]
        square += unit[axis] * unit[axis]
    distance = max(math.sqrt(square), _NEAREST_M)
    for axis in range(len(position)):
        unit[axis] /= distance
    return distance


@njit(cache=True)
def inverse_information(position: Array, anchors_m: Array, weights: Array, height_m: float, inverse: Array) -> bool:
    """Leave (Σ w_i u_i u_iᵀ)⁻¹ in `inverse` (d, d), with u_i the direction to anchor i; False when it is singular."""
    size = len(position)
    information, unit, column = np.zeros((size, size)), np.empty(size), np.empty(size)
    for number in range(len(anchors_m)):
        direction(position, anchors_m[number], height_m, unit)
        for i in range(size):
            for j in range(size):
                information[i, j] += weights[number] * unit[i] * unit[j]
    for j in range(size):
        column[:] = 0.0
        column[j] = 1.0
        if not solve_symmetric(information.copy(), column):
            return False
        inverse[:, j] = column
    return True


@njit(cache=True)
def gdop(position: Array, anchors_m: Array, weights: Array, height_m: float) -> float:
    """What a range's standard deviation becomes in position (d,); infinite where the anchors do not determine it.

    `weights` (n,) are 1 for ranges that count, 0 for others.
    """
    inverse = np.empty((len(position), len(position)))
    if not inverse_information(position, anchors_m, weights, height_m, inverse):
        return math.inf
    return math.sqrt(np.trace(inverse))
