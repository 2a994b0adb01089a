"""Values that stay while nobody moves and fade with the way gone: Gauss-Markov over way."""

import numpy as np
from numpy.typing import NDArray


class SpatialProcess:
    """`count` independent standard normal processes with correlation exp(-way / length)."""

    def __init__(self, count: int, length_m: float, rng: np.random.Generator) -> None:
        self._length_m = length_m
        self._rng = rng
        self._value = rng.standard_normal(count)

    def advance(self, which: NDArray[np.int64], moved_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Move processes `which` (k,), no doubles, by (k,) metres and return their values (k,)."""
        kept = np.exp(-moved_m / self._length_m)
        fresh = np.sqrt(1.0 - kept**2) * self._rng.standard_normal(len(which))
        self._value[which] = kept * self._value[which] + fresh
        return self._value[which]
