"""What is known of monitors and emitters before anything is heard."""

import math
from dataclasses import dataclass

from mine_loc_core.errors import ConfigurationError


@dataclass(frozen=True, slots=True)
class CoarseSettings:
    """Constants of the coarse positioning; R, r and the frequency accuracy are paper E's.

    `azimuth_sd_rad` is the noise of one bearing, `channels` how many
    there are to send on, `heard_share` the share of emissions in range that come through,
    `speed_m_s` the root mean square speed of people, `window_s` how long a report counts, `scan_s` the time within
    which one monitor reports an emission once, `future_s` how far ahead of now a stamp may lie, `lost_after_s` the
    silence after which a region is LOST and `forget_after_s` after which it is no more. A pairing is stated when its
    probability is at least `stated_probability`, and the circle of a region holds with `region_probability`.
    """

    detection_range_m: float = 5000.0
    communication_range_m: float = 2000.0
    azimuth_sd_rad: float = math.radians(2.0)
    frequency_accuracy_hz: float = 1000.0
    channels: int = 256
    heard_share: float = 0.9
    speed_m_s: float = 1.0
    window_s: float = 65.0
    scan_s: float = 1.0
    future_s: float = 1.0
    lost_after_s: float = 30.0
    forget_after_s: float = 300.0
    stated_probability: float = 0.9
    region_probability: float = 0.95

    def __post_init__(self) -> None:
        positive: tuple[str, ...] = ("detection_range_m", "communication_range_m", "azimuth_sd_rad")
        positive += ("frequency_accuracy_hz", "speed_m_s", "window_s", "scan_s", "lost_after_s", "forget_after_s")
        for name in positive:
            if not 0.0 < getattr(self, name) < math.inf:
                raise ConfigurationError(f"{name}: {getattr(self, name):g}; allowed: above 0")
        if self.channels < 1:
            raise ConfigurationError(f"channels: {self.channels}; allowed: 1 and above")
        for name in ("heard_share", "stated_probability", "region_probability"):
            if not 0.0 < getattr(self, name) < 1.0:
                raise ConfigurationError(f"{name}: {getattr(self, name):g}; allowed: between 0 and 1")
