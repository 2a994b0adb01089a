"""What a direction-finding monitor reports (paper E)."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BearingReport:
    """One bearing of one emission, at one monitor.

    `stamp_ns` is the instant of the measurement in the monitor's own clock, `azimuth_rad` the ENU yaw towards the
    emitter (east 0, counter-clockwise, in (-pi, pi]), `level_dbm` NaN where it is not reported, `confidence` 0 to 1.
    Several frequencies (`frequency_count` > 1) between start and stop are those of one hopping emitter.
    """

    monitor_id: int
    stamp_ns: int
    start_frequency_hz: float
    stop_frequency_hz: float
    frequency_count: int
    dwell_time_s: float
    level_dbm: float
    azimuth_rad: float
    confidence: float
