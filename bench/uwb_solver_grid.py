"""The settings tried for each solver of ranging rounds on real recordings: as many for one as for the other."""

import itertools
from collections.abc import Mapping

from uwb_tracks import MakeSolver

from mine_loc_uwb.least_squares import LeastSquares
from mine_loc_uwb.robust_tracker import RobustTracker, RobustTrackerSettings
from mine_loc_uwb.weighted_lm import WeightedLmFilter, WeightedLmSettings

LARGE_GDOP = 1e3
DENSITIES = (0.05, 0.1, 0.3, 1.0)


def candidates() -> Mapping[str, Mapping[str, MakeSolver]]:
    """Solver, setting in words, maker; `robust_tracker` also as it comes."""
    lm, tracker = {}, {}
    for q, floor_m in itertools.product(DENSITIES, (0.02, 0.05, 0.1)):
        lm[f"q={q} floor={floor_m}"] = _weighted_lm(q, floor_m)
    for q, bias_m in itertools.product(DENSITIES, (0.02, 0.03, 0.05)):
        tracker[f"q={q} bias={bias_m}"] = _robust_tracker(q, bias_m)
    return {
        "least_squares": {"plain": lambda: LeastSquares(LARGE_GDOP)},
        "weighted_lm": lm,
        "robust_tracker": tracker,
        "robust_tracker_default": {"default": RobustTracker},
    }


def _weighted_lm(q: float, floor_m: float) -> MakeSolver:
    settings = WeightedLmSettings(q, floor_m, max_gdop=LARGE_GDOP)
    return lambda: WeightedLmFilter(settings)


def _robust_tracker(q: float, bias_m: float) -> MakeSolver:
    settings = RobustTrackerSettings(acceleration_density_m2_s3=q, bias_sd_m=bias_m)
    return lambda: RobustTracker(settings)
