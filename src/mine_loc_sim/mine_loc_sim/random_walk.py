"""The random walk of paper E's nodes: constant speed, a new course every leg, inside a rectangle."""

import numpy as np
from numpy.typing import NDArray

from mine_loc_core.stamps import NS_PER_S
from mine_loc_sim import bearing_constants as bc

Array = NDArray[np.float64]


class RandomWalk:
    """One node that begins anywhere in a field and is thrown back at its edges.

    `low_m` and `high_m` are the field's corners (2,), `seconds` the length of the walk, after which the node stands.
    """

    def __init__(self, rng: np.random.Generator, low_m: Array, high_m: Array, seconds: float) -> None:
        legs = int(seconds * NS_PER_S // bc.LEG_NS) + 1
        course_rad = rng.uniform(-np.pi, np.pi, legs)
        steps_m = np.stack([np.cos(course_rad), np.sin(course_rad)], axis=1) * (bc.SPEED_M_S * bc.LEG_NS / NS_PER_S)
        start_m = rng.uniform(low_m, high_m)
        self._unfolded_m = start_m + np.vstack([np.zeros(2), np.cumsum(steps_m, axis=0)])
        self._stamp_ns = np.arange(legs + 1) * bc.LEG_NS
        self._low_m, self._size_m = low_m, high_m - low_m

    def __call__(self, stamp_ns: NDArray[np.int64]) -> Array:
        """Positions (n, 3) at stamps (n,), on the ground."""
        plan = [np.interp(stamp_ns, self._stamp_ns, self._unfolded_m[:, axis]) for axis in (0, 1)]
        beyond_m = (np.stack(plan, axis=1) - self._low_m) % (2.0 * self._size_m)
        folded_m = self._low_m + np.minimum(beyond_m, 2.0 * self._size_m - beyond_m)
        return np.column_stack([folded_m, np.zeros(len(stamp_ns))])
