"""The wearer's own body between tag and anchor: loss and excess way by the angle it is turned away."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mine_loc_sim import radio_constants as constants
from mine_loc_sim.gauss_markov import GaussMarkov


@dataclass(frozen=True, slots=True)
class Wearer:
    """How one person's body shadows; both hold straight behind the back."""

    loss_db: float
    delay_m: float

    @staticmethod
    def draw(rng: np.random.Generator) -> "Wearer":
        """Draw a person."""
        return Wearer(rng.uniform(*constants.BODY_LOSS_DB), rng.uniform(*constants.BODY_DELAY_M))

    def shadow(
        self, off_facing_rad: NDArray[np.float64], variation: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Loss [dB] and excess way [m], both (n,).

        off_facing_rad: angle between where the person faces and the anchor; variation: standard normal (n,), slow.
        """
        behind = np.maximum(0.0, -np.cos(off_facing_rad))
        return self.loss_db * behind, np.maximum(0.0, self.delay_m + constants.BODY_DELAY_SD_M * variation) * behind


def body_process(count: int, rng: np.random.Generator) -> GaussMarkov:
    """Variation of the excess way from place to place for `count` links."""
    return GaussMarkov(count, constants.SLOW_BIAS_LENGTH_M, rng)
