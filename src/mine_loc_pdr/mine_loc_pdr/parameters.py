"""Parameters of this package's nodes: types, units, ranges and what they mean."""

from dataclasses import dataclass

from mine_loc_core.parameters import NodeParameters, parameter


@dataclass(frozen=True)
class N100DriverParameters(NodeParameters):
    """Parameters of `n100_driver`; standard deviations as REP 145 names them, 0 = unknown."""

    person: str = parameter("", "who wears the device; prefix of its frame", read_only=True)
    port: str = parameter(
        "", "device, glob pattern, socket://host:port (raw TCP bridge) or hwgrep://VID:PID", read_only=True
    )
    baud: int = parameter(921_600, "line speed", unit="bit/s", low=1200, high=4_000_000, read_only=True)
    # Assumed: ten times the class figures of such sensors at 100 Hz, because the maker gives none.
    linear_acceleration_stddev: float = parameter(0.05, "of a sample, each axis", unit="m/s^2", low=0.0, high=100.0)
    angular_velocity_stddev: float = parameter(0.01, "of a sample, each axis", unit="rad/s", low=0.0, high=100.0)
    orientation_stddev: float = parameter(0.05, "of the device's attitude, each axis", unit="rad", low=0.0, high=3.2)
    magnetic_field_stddev: float = parameter(1e-6, "of a sample, each axis", unit="T", low=0.0, high=1.0)
    magnetic_field_rate: float = parameter(
        10.0, "of imu/mag, at most that of the samples", unit="Hz", low=0.1, high=1000.0
    )
    stamp_on_arrival: bool = parameter(False, "stamp with the arrival instead of the device's own time", read_only=True)
    latency_ms: float = parameter(
        0.0, "known delay from sampling to the earliest arrival", unit="ms", low=0.0, high=1000.0, read_only=True
    )


@dataclass(frozen=True)
class PdrParameters(NodeParameters):
    """Parameters of `pdr`."""

    mounting: str = parameter(
        "walking",
        "yaw of base_link to imu_link: as found from walking, or as people.yaml states (mounting_rpy_deg)",
        choices=("walking", "stated"),
    )
    odometry_rate: float = parameter(10.0, "of <person>/odometry and /tf", unit="Hz", low=0.1, high=200.0)
    step_detector: str = parameter(
        "network",
        "a trained network, or paper B's peaks and valleys for devices without a gyro",
        choices=("network", "peaks"),
        read_only=True,
    )
    step_model: str = parameter(
        "", "file written by mine-loc train-steps; empty = the one that is shipped", read_only=True
    )
    activity_model: str = parameter(
        "", "file written by mine-loc train-activity; empty = the one that is shipped", read_only=True
    )
