"""Verdicts to messages."""

from collections.abc import Iterable

from builtin_interfaces.msg import Time
from mine_loc_interfaces.msg import MeasurementVerdict, MeasurementVerdictArray

from mine_loc_core.verdicts import Verdict


def to_verdict_array(
    verdicts: Iterable[Verdict], stamp: Time, frame_id: str, *, tag_id: int = 0, person: str = ""
) -> MeasurementVerdictArray:
    """Verdicts on one round or epoch."""
    array = MeasurementVerdictArray(tag_id=tag_id, person=person)
    array.header.stamp = stamp
    array.header.frame_id = frame_id
    array.verdicts = [
        MeasurementVerdict(
            source=int(verdict.source),
            sensor_id=verdict.sensor_id,
            accepted=verdict.accepted,
            reason=int(verdict.reason),
            mahalanobis_sq=verdict.mahalanobis_sq,
            threshold=verdict.threshold,
            degrees_of_freedom=verdict.degrees_of_freedom,
            innovation=verdict.innovation,
            age=verdict.age_s,
        )
        for verdict in verdicts
    ]
    return array
