"""Parameters of the fusion nodes."""

from dataclasses import dataclass

from mine_loc_core.parameters import NodeParameters, parameter

_FUTURE_MS = 50.0
METHODS = ("mine_loc", "los_weighted", "los_weighted_residual", "robust_kf", "ekf", "adaptive_ekf")


@dataclass(frozen=True)
class SynchroniserParameters(NodeParameters):
    """Time alignment."""

    companion_wait_ms: float = parameter(
        8.0, "how long a ranging round waits for its link states, or else its position", unit="ms", low=0.0, high=200.0
    )
    history_s: float = parameter(
        2.0, "inputs older than the last epoch by more are stale", unit="s", low=0.1, high=30.0
    )
    future_ms: float = parameter(
        _FUTURE_MS, "stamps ahead of now by more are refused", unit="ms", low=0.0, high=10_000.0
    )
    max_open: int = parameter(64, "open epochs a person; the oldest goes out when there are more", low=1, high=1024)


@dataclass(frozen=True)
class FusionParameters(NodeParameters):
    """One pose per person."""

    instance: str = parameter("fusion", "name of this instance in its outputs", read_only=True)
    people: str = parameter(
        "", "names of the people this instance serves, with commas between; empty = all", read_only=True
    )
    method: str = parameter("mine_loc", "estimator of a person", choices=METHODS)
    range_correction: str = parameter(
        "", "file of `mine-loc fit-ranges`; a relative path starts at the site's folder; empty = none", read_only=True
    )
    systematic_sd: float = parameter(
        0.2, "error of a link's ranges that stays; less where radios are calibrated", unit="m", low=0.0, high=5.0
    )
    max_range_m: float = parameter(300.0, "longer ranges are impossible", unit="m", low=1.0, high=1000.0)
    arrival_sd_m: float = parameter(0.15, "standard deviation of a blink's arrivals", unit="m", low=0.001, high=10.0)
    uwb_timeout_s: float = parameter(
        1.0, "no position for so long: dead reckoning or coasting", unit="s", low=0.1, high=60.0
    )
    region_after_s: float = parameter(
        10.0, "coarse regions count after so long without a position", unit="s", low=1.0, high=3600.0
    )
    step_timeout_s: float = parameter(
        2.0, "no step for so long: standing, or no step detector", unit="s", low=0.1, high=60.0
    )
    lost_ce95_m: float = parameter(50.0, "a circle of 95 % beyond it means lost", unit="m", low=1.0, high=1000.0)
    coast_period_s: float = parameter(0.2, "outputs without inputs come this often", unit="s", low=0.02, high=5.0)
    future_ms: float = parameter(
        _FUTURE_MS, "set_pose with a stamp ahead of now by more is refused", unit="ms", low=0.0, high=10_000.0
    )
    history_s: float = parameter(2.0, "late inputs are corrected this far back", unit="s", low=0.1, high=30.0)
