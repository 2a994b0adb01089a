"""Health to diagnostic_msgs (REP 107)."""

from collections.abc import Iterable

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from mine_loc_core.health import Health
from mine_loc_core.nodes.conversions import to_time

PERIOD_S = 1.0


def to_diagnostic_array(full_name: str, statuses: Iterable[Health], stamp_ns: int) -> DiagnosticArray:
    """What a node of a full name says of its components."""
    array = DiagnosticArray(status=[_status(full_name, health) for health in statuses])
    array.header.stamp = to_time(stamp_ns)
    return array


def _status(node: str, health: Health) -> DiagnosticStatus:
    return DiagnosticStatus(
        level=bytes([health.level]),
        name=f"{node.lstrip('/')}: {health.component}",
        message=health.message,
        hardware_id=health.hardware_id,
        values=[KeyValue(key=str(key), value=str(value)) for key, value in health.values.items()],
    )
