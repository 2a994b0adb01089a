"""Parameters of the UWB nodes."""

from dataclasses import dataclass

from mine_loc_core.parameters import NodeParameters, parameter
from mine_loc_uwb.wire.detect import FORMATS

RANGE_METHODS = ("robust_tracker", "least_squares", "weighted_lm", "ekf", "particle_filter")
TDOA_METHODS = ("robust_tracker", "tdoa_rss", "ekf", "particle_filter")
"""Keys of the tables in `solvers`, which is slow to import."""


@dataclass(frozen=True)
class Dwm1000DriverParameters(NodeParameters):
    """One serial line that carries ranges, time differences or CIR frames."""

    receiver: str = parameter("", "name of the line in site.yaml", read_only=True)
    port: str = parameter("", "path, glob pattern, socket://host:port or hwgrep://VID:PID", read_only=True)
    baud: int = parameter(115200, "speed of the line", unit="baud", low=1200, high=4_000_000, read_only=True)
    format: str = parameter("auto", "wire format", choices=("auto", *FORMATS), read_only=True)
    latency_ms: float = parameter(0.0, "constant delay from exchange to arrival", unit="ms", low=0.0, high=1000.0)
    trust_device_clock: bool = parameter(True, "stamp by the device's clock; false stamps on arrival")
    range_sd_m: float = parameter(0.1, "standard deviation given to ranges", unit="m", low=0.001, high=10.0)
    silence_s: float = parameter(0.8, "no message for so long is an error", unit="s", low=0.1, high=60.0)


@dataclass(frozen=True)
class LosClassifierParameters(NodeParameters):
    """LOS or NLOS from CIR frames."""

    model: str = parameter("", "file written by mine-loc train-los; empty = the one that is shipped", read_only=True)
    device: str = parameter("cpu", "where the network runs", choices=("cpu", "cuda"), read_only=True)


@dataclass(frozen=True)
class UwbSolverParameters(NodeParameters):
    """Positions from ranging rounds."""

    method: str = parameter("robust_tracker", "solver of ranging rounds", choices=RANGE_METHODS)
    tdoa_method: str = parameter("robust_tracker", "solver of blinks", choices=TDOA_METHODS)
    frame: str = parameter(
        "",
        "whose anchors: map, or the id of a vehicle that carries them; empty = the map's if it has any",
        read_only=True,
    )
    range_correction: str = parameter(
        "", "file of `mine-loc fit-ranges`; a relative path starts at the site's folder; empty = none", read_only=True
    )
    max_range_m: float = parameter(300.0, "longer ranges are impossible", unit="m", low=1.0, high=1000.0)
    arrival_sd_m: float = parameter(0.15, "standard deviation of a blink's arrivals", unit="m", low=0.001, high=10.0)
    max_gdop: float = parameter(10.0, "geometry beyond it is degenerate", unit="1", low=1.0, high=1000.0)
    acceleration_density: float = parameter(
        0.1, "spectral density of a person's acceleration", unit="m^2/s^3", low=1e-4, high=100.0
    )
    systematic_sd: float = parameter(
        0.2, "error of a link's ranges that stays; less where radios are calibrated", unit="m", low=0.0, high=5.0
    )
    top_speed: float = parameter(3.0, "nobody moves faster against the anchors", unit="m/s", low=0.5, high=50.0)
    nlos_share: float = parameter(0.5, "share of links that are obstructed here", unit="1", low=0.01, high=0.95)
    nlos_excess: float = parameter(0.6, "mean excess way of an obstructed link", unit="m", low=0.01, high=20.0)
    path_loss_exponent: float = parameter(
        0.0, "of levels over distance, 1.2 in a clear gallery; 0 = levels are not used", unit="1", low=0.0, high=6.0
    )
    path_loss_level_1m: float = parameter(-71.0, "level at a metre", unit="dBm", low=-120.0, high=0.0)
    path_loss_shadowing: float = parameter(6.0, "standard deviation of levels about it", unit="dB", low=0.1, high=30.0)
    gate: float = parameter(
        0.9999, "probability that a range as it should be passes", unit="1", low=0.9, high=0.9999999
    )
    reopen_after_s: float = parameter(
        2.0, "most ranges refused for so long: begin anew where they agree", unit="s", low=0.2, high=60.0
    )
