"""Values that stay while nobody moves, or for a while, and then fade: Gauss-Markov over way or time."""

import numpy as np
from numpy.typing import NDArray


class GaussMarkov:
    """`count` independent standard normal processes with correlation exp(-step / scale); scale in m or s."""

    def __init__(self, count: int, scale: float, rng: np.random.Generator) -> None:
        self._scale = scale
        self._rng = rng
        self._value = rng.standard_normal(count)

    def advance(self, which: NDArray[np.int64], step: NDArray[np.float64]) -> NDArray[np.float64]:
        """Move processes `which` (k,), no doubles, by steps (k,) >= 0 and return their values (k,)."""
        return self.walk(which[None], step[None])

    def walk(self, which: NDArray[np.int64], step: NDArray[np.float64]) -> NDArray[np.float64]:
        """Advance row by row; which and step: (r, k), no doubles in a row. Returns (r x k,)."""
        kept = np.exp(-step / self._scale)
        fresh = np.sqrt(1.0 - kept**2) * self._rng.standard_normal(which.shape)
        state, values = self._value.tolist(), []
        steps = zip(which.ravel().tolist(), kept.ravel().tolist(), fresh.ravel().tolist(), strict=True)
        for process, share, news in steps:  # row by row: numbers outrun arrays as short as these rows
            state[process] = value = share * state[process] + news
            values.append(value)
        self._value = np.array(state)
        return np.array(values)
