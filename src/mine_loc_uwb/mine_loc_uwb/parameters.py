"""Parameters of the UWB nodes."""

from dataclasses import dataclass

from mine_loc_core.parameters import NodeParameters, parameter
from mine_loc_uwb.wire.detect import FORMATS


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

    method: str = parameter("least_squares", "solver", choices=("least_squares",))
    max_range_m: float = parameter(300.0, "longer ranges are impossible", unit="m", low=1.0, high=1000.0)
    max_gdop: float = parameter(10.0, "geometry beyond it is degenerate", unit="1", low=1.0, high=1000.0)
