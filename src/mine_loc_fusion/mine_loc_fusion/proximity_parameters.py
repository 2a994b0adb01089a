"""Parameters of the proximity and relay nodes."""

from dataclasses import dataclass

from mine_loc_core.parameters import NodeParameters, parameter


@dataclass(frozen=True)
class ProximityParameters(NodeParameters):
    """People near machines. All hold from start to end: no alarm may be lost by a change."""

    danger_enter: float = parameter(
        0.1,
        "probability of being inside from which on somebody is in danger",
        unit="1",
        low=0.01,
        high=0.99,
        read_only=True,
    )
    danger_leave: float = parameter(
        0.02, "probability below which the danger may end", unit="1", low=0.0, high=0.99, read_only=True
    )
    danger_dwell_s: float = parameter(
        0.0, "a danger begins when danger_enter held for so long", unit="s", low=0.0, high=2.0, read_only=True
    )
    warning_enter: float = parameter(
        0.1,
        "probability of being inside from which on somebody is warned of",
        unit="1",
        low=0.01,
        high=0.99,
        read_only=True,
    )
    warning_leave: float = parameter(
        0.02, "probability below which the warning may end", unit="1", low=0.0, high=0.99, read_only=True
    )
    warning_dwell_s: float = parameter(
        0.0, "a warning begins when warning_enter held for so long", unit="s", low=0.0, high=5.0, read_only=True
    )
    leave_dwell_s: float = parameter(
        1.0,
        "danger and warning end when the lower probability held for so long",
        unit="s",
        low=0.0,
        high=60.0,
        read_only=True,
    )
    silence_s: float = parameter(0.5, "no poses for so long: stop", unit="s", low=0.1, high=5.0, read_only=True)
    alive_s: float = parameter(
        3.0,
        "nobody positioned and no health of the fusion for so long: stop",
        unit="s",
        low=1.0,
        high=10.0,
        read_only=True,
    )
    pose_timeout_s: float = parameter(
        0.5, "a person's pose that is older says where they were", unit="s", low=0.1, high=10.0, read_only=True
    )
    vague_m: float = parameter(
        5.0, "a wider circle of 95 % does not say where a person is", unit="m", low=0.5, high=100.0, read_only=True
    )
    top_speed_m_s: float = parameter(
        3.0, "how fast a person moves whose place is not known", unit="m/s", low=0.5, high=10.0, read_only=True
    )
    vehicle_timeout_s: float = parameter(
        0.5, "a vehicle's pose that is older says where it was: stop", unit="s", low=0.1, high=10.0, read_only=True
    )
    heartbeat_s: float = parameter(
        0.1, "how often each vehicle is told to run or stop", unit="s", low=0.02, high=1.0, read_only=True
    )
    valid_for_s: float = parameter(
        0.5,
        "a receiver stops by itself when no heartbeat came for so long",
        unit="s",
        low=0.1,
        high=5.0,
        read_only=True,
    )


@dataclass(frozen=True)
class RelayParameters(NodeParameters):
    """Outputs that hold a vehicle."""

    relay: str = parameter("", "name of the relay in site.yaml", read_only=True)
    write_period_s: float = parameter(
        0.1, "how often the outputs are written", unit="s", low=0.02, high=1.0, read_only=True
    )
    timeout_s: float = parameter(
        0.3, "how long a device may take to answer", unit="s", low=0.05, high=2.0, read_only=True
    )


@dataclass(frozen=True)
class MarkersParameters(NodeParameters):
    """The live map."""

    period_s: float = parameter(
        0.2, "how often people and vehicles are drawn", unit="s", low=0.05, high=0.9, read_only=True
    )
