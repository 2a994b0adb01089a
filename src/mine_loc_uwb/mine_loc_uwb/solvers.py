"""The position solvers by name, as the node's parameters set them up."""

from collections.abc import Callable, Mapping

from mine_loc_uwb.least_squares import LeastSquares
from mine_loc_uwb.parameters import UwbSolverParameters
from mine_loc_uwb.robust_tracker import RobustTracker, RobustTrackerSettings
from mine_loc_uwb.solver import Solver
from mine_loc_uwb.weighted_lm import WeightedLmFilter, WeightedLmSettings

MakeSolver = Callable[[UwbSolverParameters], Solver]


def _least_squares(parameters: UwbSolverParameters) -> Solver:
    return LeastSquares(parameters.max_gdop)


def _weighted_lm(parameters: UwbSolverParameters) -> Solver:
    return WeightedLmFilter(
        WeightedLmSettings(acceleration_density_m2_s3=parameters.acceleration_density, max_gdop=parameters.max_gdop)
    )


def _robust_tracker(parameters: UwbSolverParameters) -> Solver:
    return RobustTracker(
        RobustTrackerSettings(
            acceleration_density_m2_s3=parameters.acceleration_density,
            top_speed_m_s=parameters.top_speed,
            nlos_share=parameters.nlos_share,
            gate=parameters.gate,
            reopen_after_s=parameters.reopen_after_s,
        )
    )


RANGE_SOLVERS: Mapping[str, MakeSolver] = {
    "robust_tracker": _robust_tracker,
    "least_squares": _least_squares,
    "weighted_lm": _weighted_lm,
}
"""Take ranging rounds."""

TDOA_SOLVERS: Mapping[str, MakeSolver] = {"robust_tracker": _robust_tracker}
"""Take the arrivals of blinks."""
