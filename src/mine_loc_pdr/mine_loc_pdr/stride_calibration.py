"""The scale K of a person's step-length model from walks of known length."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

# How one walk's K scatters about the person's, relative: within people of ipol_gait_lowerback (bench/pdr.py).
WALK_TO_WALK_SD = 0.04


@dataclass(frozen=True, slots=True)
class StrideCalibration:
    """K and its standard error; `spread` is the standard deviation of the walks' own K, None for a single walk."""

    scale: float
    standard_error: float
    spread: float | None


def calibrate_scale(walked_m: Sequence[float], modelled_m: Sequence[float]) -> StrideCalibration:
    """K from the true lengths of walks and the lengths that the model gives with K = 1, one of each a walk.

    The ratio of the sums, so that a long walk counts for more than a short one. The standard error is that of the
    walks' spread, not below the usual one. Raises ValueError when there is no walk or a length is not positive.
    """
    if not walked_m or len(walked_m) != len(modelled_m):
        raise ValueError(f"{len(walked_m)} true lengths, {len(modelled_m)} modelled; needed: one of each a walk")
    if not all(math.isfinite(x) and x > 0.0 for x in (*walked_m, *modelled_m)):
        raise ValueError(f"lengths {list(walked_m)} and {list(modelled_m)}: all must be positive")
    n = len(walked_m)
    scale = sum(walked_m) / sum(modelled_m)
    ratios = [true / found for true, found in zip(walked_m, modelled_m, strict=True)]
    spread = math.sqrt(sum((r - scale) ** 2 for r in ratios) / (n - 1)) if n > 1 else None
    standard_error = max(spread or 0.0, WALK_TO_WALK_SD * scale) / math.sqrt(n)
    return StrideCalibration(scale, standard_error, spread)
