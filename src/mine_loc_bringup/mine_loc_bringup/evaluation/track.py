"""What is evaluated: the poses that were put out for a person, and where the person was."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from mine_loc_fusion.mode import Mode

Array = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Booleans = npt.NDArray[np.bool_]

_NOT_MEASURED = [Mode.COASTING, Mode.COARSE_ONLY, Mode.LOST]
_NOT_VALID = [Mode.INITIALISING, Mode.LOST]


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Outputs of one person in the order they came: `stamp_ns`, `logged_ns` (n,), when the bag had them.

    Positions (n, 2) [m] with covariances (n, 2, 2) [m²], claimed 95 % circles (n,) [m], modes (n,) of PersonPose.
    """

    stamp_ns: Integers
    logged_ns: Integers
    position_m: Array
    covariance_m2: Array
    ce95_m: Array
    modes: Integers

    def __len__(self) -> int:
        return len(self.stamp_ns)

    @property
    def finite(self) -> Booleans:
        """Outputs whose position is a number."""
        return np.asarray(np.isfinite(self.position_m).all(axis=1))

    @property
    def valid(self) -> Booleans:
        """Outputs that claim to know the place: not LOST, not INITIALISING, and finite."""
        return np.asarray(self.finite & ~np.isin(self.modes, _NOT_VALID))

    @property
    def measured(self) -> Booleans:
        """Valid outputs that rest on a measurement of their instant, not on prediction or a coarse region alone."""
        return np.asarray(self.valid & ~np.isin(self.modes, _NOT_MEASURED))

    def only(self, which: npt.NDArray[Any]) -> "Track":
        """Some outputs."""
        return replace(self, **{name: getattr(self, name)[which] for name in self.__slots__})


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """Positions (m, 2) [m] at increasing `stamp_ns` (m,), in `frame`."""

    stamp_ns: Integers
    position_m: Array
    frame: str = "map"


@dataclass(frozen=True, slots=True)
class StepCount:
    """Heel strikes that truly were and that were found, over the time in which they are known."""

    true: int
    found: int
