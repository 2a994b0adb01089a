"""The position solvers by name, as the node's parameters set them up."""

from collections.abc import Callable, Mapping

from mine_loc_uwb.blink_likelihood import TdoaRssParameters
from mine_loc_uwb.ekf import Ekf, EkfParameters
from mine_loc_uwb.late_arrival import LateArrival
from mine_loc_uwb.least_squares import LeastSquares
from mine_loc_uwb.parameters import UwbSolverParameters
from mine_loc_uwb.particle_filter import ParticleFilter, ParticleFilterParameters
from mine_loc_uwb.path_loss import PathLoss
from mine_loc_uwb.robust_tracker import RobustTracker
from mine_loc_uwb.solver import Solver
from mine_loc_uwb.tdoa_rss import TdoaRss
from mine_loc_uwb.tracker_settings import RobustTrackerSettings
from mine_loc_uwb.weighted_lm import WeightedLmFilter, WeightedLmSettings

MakeSolver = Callable[[UwbSolverParameters], Solver]


def _path_loss(p: UwbSolverParameters) -> PathLoss | None:
    if p.path_loss_exponent == 0.0:
        return None
    return PathLoss(p.path_loss_level_1m, p.path_loss_exponent, p.path_loss_shadowing)


def _least_squares(p: UwbSolverParameters) -> Solver:
    return LeastSquares(p.max_gdop)


def _weighted_lm(p: UwbSolverParameters) -> Solver:
    return WeightedLmFilter(WeightedLmSettings(p.acceleration_density, max_gdop=p.max_gdop))


def _tdoa_rss(p: UwbSolverParameters) -> Solver:
    return TdoaRss(TdoaRssParameters(_path_loss(p), p.nlos_share * p.nlos_excess, max_gdop=p.max_gdop))


def _ekf(p: UwbSolverParameters) -> Solver:
    excess_sd_m = p.nlos_share * p.nlos_excess
    return Ekf(EkfParameters(_path_loss(p), excess_sd_m=excess_sd_m, gate_probability=p.gate, max_gdop=p.max_gdop))


def _particle_filter(p: UwbSolverParameters) -> Solver:
    law = LateArrival(p.nlos_share, p.nlos_excess)
    return ParticleFilter(
        ParticleFilterParameters(_path_loss(p), law=law, gate_probability=p.gate, max_gdop=p.max_gdop)
    )


def _robust_tracker(p: UwbSolverParameters) -> Solver:
    return RobustTracker(
        RobustTrackerSettings(
            acceleration_density_m2_s3=p.acceleration_density,
            systematic_sd_m=p.systematic_sd,
            nlos_scale_m=p.nlos_excess,
            nlos_share=p.nlos_share,
            path_loss=_path_loss(p),
            top_speed_m_s=p.top_speed,
            gate=p.gate,
            reopen_after_s=p.reopen_after_s,
        )
    )


RANGE_SOLVERS: Mapping[str, MakeSolver] = {
    "robust_tracker": _robust_tracker,
    "least_squares": _least_squares,
    "weighted_lm": _weighted_lm,
    "ekf": _ekf,
    "particle_filter": _particle_filter,
}
"""Take ranging rounds."""

TDOA_SOLVERS: Mapping[str, MakeSolver] = {
    "robust_tracker": _robust_tracker,
    "tdoa_rss": _tdoa_rss,
    "ekf": _ekf,
    "particle_filter": _particle_filter,
}
"""Take the arrivals of blinks."""
