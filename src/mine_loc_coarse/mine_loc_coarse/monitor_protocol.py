"""The line of a direction-finding monitor, over TCP or serial: NMEA 0183 framing around the fields of paper E.

    $MLDF,monitor,time,start,stop,count,dwell,level,azimuth,confidence*hh

    monitor      1 to 2**32 - 1
    time         of the measurement, microseconds of the monitor's clock, below 2**63 / 1000
    start, stop  of the emission [Hz]
    count        of frequencies, 1 to 2**32 - 1
    dwell        [s] with three decimals
    level        [dBm] with one decimal, empty = not reported
    azimuth      [deg] from north clockwise, 000.00 to 359.99
    confidence   0.00 to 1.00
    hh           exclusive or of all characters between $ and *, two capital hexadecimal digits

Numbers have no leading zeros but the azimuth's, which has always three digits before the point. The exclusive or finds
every damage of a single character; a line that deviates anywhere from the format is dropped whole.
"""

import math
import re
from functools import reduce
from operator import xor

from mine_loc_coarse.bearing_report import BearingReport
from mine_loc_core.framing import Damaged
from mine_loc_core.line_decoder import LineDecoder
from mine_loc_core.line_splitter import LINE_END
from mine_loc_core.stamps import NS_PER_US

_BOUNDARY = LINE_END + rb"|(?=\$)"
_SENTENCE = re.compile(r"\$(MLDF,[^$*]*)\*([0-9A-F]{2})")
_WHOLE = r"(0|[1-9][0-9]{0,15})"
_FIELDS = re.compile(
    rf"MLDF,{_WHOLE},{_WHOLE},{_WHOLE},{_WHOLE},{_WHOLE},([0-9]{{1,4}}\.[0-9]{{3}}),(-?[0-9]{{1,3}}\.[0-9])?,"
    r"([0-3][0-9]{2}\.[0-9]{2}),([01]\.[0-9]{2})"
)
_FIELD_COUNT = 10
_LAST_UINT32 = 2**32 - 1
_LAST_STAMP_NS = 2**63 - 1


def decoder() -> LineDecoder[BearingReport]:
    """Decoder of a monitor's stream; a `$` begins a line even where the end of the one before was lost."""
    return LineDecoder(decode_line, _BOUNDARY)


def decode_line(line: str) -> BearingReport | Damaged:
    """Decode one line. Losses: unrecognised_line, checksum, field_count, field_value."""
    sentence = _SENTENCE.fullmatch(line)
    if sentence is None:
        return Damaged("unrecognised_line")
    content, told = sentence.groups()
    if checksum(content) != int(told, 16):
        return Damaged("checksum")
    if content.count(",") + 1 != _FIELD_COUNT:
        return Damaged("field_count")
    fields = _FIELDS.fullmatch(content)
    report = None if fields is None else _report(fields)
    return Damaged("field_value") if report is None else report


def encode_report(report: BearingReport) -> bytes:
    """Encode a report, rounded to what the line can say. Raises ValueError for one that it cannot say."""
    level = "" if math.isnan(report.level_dbm) else f"{report.level_dbm:.1f}"
    content = (
        f"MLDF,{report.monitor_id},{report.stamp_ns // NS_PER_US},{report.start_frequency_hz:.0f},"
        f"{report.stop_frequency_hz:.0f},{report.frequency_count},{report.dwell_time_s:.3f},{level},"
        f"{round(compass_deg(report.azimuth_rad), 2) % 360.0:06.2f},{report.confidence:.2f}"
    )
    line = f"${content}*{checksum(content):02X}"
    unfit = isinstance(decode_line(line), Damaged)
    if unfit:
        raise ValueError(f"{report} does not fit the wire; allowed: what the fields of the monitors' line hold")
    return f"{line}\r\n".encode("ascii")


def checksum(content: str) -> int:
    """Exclusive or of the characters between `$` and `*`, as NMEA 0183 has it."""
    return reduce(xor, content.encode("utf-8"), 0)


def compass_deg(yaw_rad: float) -> float:
    """ENU yaw to degrees from north clockwise, in [0, 360]."""
    return (90.0 - math.degrees(yaw_rad)) % 360.0


def yaw_rad(azimuth_deg: float) -> float:
    """Degrees from north clockwise to ENU yaw in (-pi, pi]."""
    return math.radians(180.0 - (azimuth_deg + 90.0) % 360.0)


def _report(fields: re.Match[str]) -> BearingReport | None:
    monitor_id, stamp_us, start_hz, stop_hz, count = map(int, fields.groups()[:5])
    dwell, level, azimuth, confidence = fields.groups()[5:]
    sensible = (
        0 < monitor_id <= _LAST_UINT32
        and stamp_us * NS_PER_US <= _LAST_STAMP_NS
        and start_hz <= stop_hz
        and 0 < count <= _LAST_UINT32
        and float(azimuth) < 360.0
        and float(confidence) <= 1.0
    )
    if not sensible:
        return None
    return BearingReport(
        monitor_id=monitor_id,
        stamp_ns=stamp_us * NS_PER_US,
        start_frequency_hz=float(start_hz),
        stop_frequency_hz=float(stop_hz),
        frequency_count=count,
        dwell_time_s=float(dwell),
        level_dbm=float(level) if level else math.nan,
        azimuth_rad=yaw_rad(float(azimuth)),
        confidence=float(confidence),
    )
