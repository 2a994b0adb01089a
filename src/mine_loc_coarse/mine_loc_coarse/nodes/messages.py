"""Reports and regions as ROS messages, and back."""

from collections.abc import Iterator, Sequence

from mine_loc_interfaces.msg import Bearing, BearingArray, CoarseRegion

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_coarse.situation import Region
from mine_loc_core.nodes.conversions import to_point, to_time
from mine_loc_core.stamps import to_stamp_ns

_LAST_UINT32 = 2**32 - 1
_MOST_NEIGHBOURS = 256
_MOST_NAMES = 64
_MOST_BEARINGS = 4096


def to_bearing_arrays(reports: Sequence[tuple[BearingReport, int]], variance_rad2: float) -> Iterator[BearingArray]:
    """Reports with the ROS time [ns] of their measurement, in messages that are not too long."""
    for start in range(0, len(reports), _MOST_BEARINGS):
        part = reports[start : start + _MOST_BEARINGS]
        message = BearingArray(bearings=[to_bearing(report, stamp_ns, variance_rad2) for report, stamp_ns in part])
        message.header.stamp = to_time(max(stamp_ns for _, stamp_ns in part))
        message.header.frame_id = "map"
        yield message


def to_bearing(report: BearingReport, stamp_ns: int, variance_rad2: float) -> Bearing:
    """A report, measured at `stamp_ns` of ROS time."""
    return Bearing(
        monitor_id=report.monitor_id,
        stamp=to_time(stamp_ns),
        start_frequency=report.start_frequency_hz,
        stop_frequency=report.stop_frequency_hz,
        frequency_count=min(report.frequency_count, _LAST_UINT32),
        dwell_time=report.dwell_time_s,
        level=report.level_dbm,
        azimuth=report.azimuth_rad,
        azimuth_variance=variance_rad2,
        confidence=report.confidence,
    )


def from_bearing(message: Bearing) -> BearingReport:
    """What a message says; whether it makes sense is judged where reports are admitted."""
    return BearingReport(
        monitor_id=message.monitor_id,
        stamp_ns=to_stamp_ns(message.stamp),
        start_frequency_hz=message.start_frequency,
        stop_frequency_hz=message.stop_frequency,
        frequency_count=message.frequency_count,
        dwell_time_s=message.dwell_time,
        level_dbm=message.level,
        azimuth_rad=message.azimuth,
        confidence=message.confidence,
    )


def to_region(region: Region, person: str) -> CoarseRegion:
    """A region of the situation; `person` empty = nobody's that is known."""
    return CoarseRegion(
        region_id=region.id,
        person=person,
        frequency=region.frequency_hz,
        center=to_point((*region.centre_m, 0.0)),
        covariance=region.covariance_m2.reshape(4),
        radius=region.radius_m,
        probability=region.probability,
        confidence=region.confidence,
        monitor_ids=list(region.monitor_ids[:_MOST_NAMES]),
        neighbour_ids=list(region.neighbour_ids[:_MOST_NEIGHBOURS]),
        galleries=list(region.galleries[:_MOST_NAMES]),
        status=int(region.status),
        last_heard=to_time(region.last_heard_ns),
    )
