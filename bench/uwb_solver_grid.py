"""The settings tried for each solver of ranging rounds on real recordings: as many for one as for the other."""

import itertools
from collections.abc import Mapping

from uwb_tracks import MakeSolver

from mine_loc_uwb.ekf import Ekf, EkfParameters
from mine_loc_uwb.least_squares import LeastSquares
from mine_loc_uwb.particle_filter import ParticleFilter, ParticleFilterParameters
from mine_loc_uwb.robust_tracker import RobustTracker
from mine_loc_uwb.tracker_settings import RobustTrackerSettings
from mine_loc_uwb.weighted_lm import WeightedLmFilter, WeightedLmSettings

LARGE_GDOP = 1e3
CALIBRATED_SD_M = 0.02
"""What a link's constants, found on another run, leave open."""
DENSITIES = (0.1, 0.2, 0.5)


def candidates() -> Mapping[str, Mapping[str, MakeSolver]]:
    """Solver, setting in words, maker: six settings each of those that have any; `robust_tracker` also as it comes."""
    lm, ekf, particles, tracker = {}, {}, {}, {}
    for q, error_m in itertools.product(DENSITIES, (0.02, 0.05)):
        lm[f"q={q} floor={error_m}"] = _weighted_lm(WeightedLmSettings(q, error_m, max_gdop=LARGE_GDOP))
    for q, share in itertools.product(DENSITIES, (0.1, 0.5)):
        tracker[f"q={q} nlos_share={share}"] = _robust_tracker(
            RobustTrackerSettings(q, CALIBRATED_SD_M, nlos_share=share, systematic_sd_m=CALIBRATED_SD_M)
        )
    for jerk, error_m in itertools.product((0.03, 0.1, 0.3), (0.05, 0.1)):
        ekf[f"jerk={jerk} excess={error_m}"] = _ekf(
            EkfParameters(jerk_density_m2_s5=jerk, excess_sd_m=error_m, max_gdop=LARGE_GDOP)
        )
        particles[f"jerk={jerk} core={error_m}"] = _particle_filter(
            ParticleFilterParameters(jerk_density_m2_s5=jerk, core_sd_m=error_m, max_gdop=LARGE_GDOP)
        )
    return {
        "least_squares": {"plain": lambda: LeastSquares(LARGE_GDOP)},
        "weighted_lm": lm,
        "ekf": ekf,
        "particle_filter": particles,
        "robust_tracker": tracker,
        "robust_tracker_default": {"default": RobustTracker},
    }


def _weighted_lm(settings: WeightedLmSettings) -> MakeSolver:
    return lambda: WeightedLmFilter(settings)


def _ekf(parameters: EkfParameters) -> MakeSolver:
    return lambda: Ekf(parameters)


def _particle_filter(parameters: ParticleFilterParameters) -> MakeSolver:
    return lambda: ParticleFilter(parameters)


def _robust_tracker(settings: RobustTrackerSettings) -> MakeSolver:
    return lambda: RobustTracker(settings)
