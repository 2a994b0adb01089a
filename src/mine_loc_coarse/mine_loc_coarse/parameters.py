"""Parameters of the nodes of coarse positioning."""

import math
from dataclasses import dataclass

from mine_loc_coarse.settings import CoarseSettings
from mine_loc_core.parameters import NodeParameters, parameter


@dataclass(frozen=True)
class MonitorDriverParameters(NodeParameters):
    """The line of one direction-finding monitor, or of a concentrator that carries several."""

    port: str = parameter("", "path, glob pattern, socket://host:port or hwgrep://VID:PID", read_only=True)
    baud: int = parameter(115200, "speed of the line", unit="baud", low=1200, high=4_000_000, read_only=True)
    stamp_by_monitor: bool = parameter(
        False,
        "take the monitors' stamps as they are, where their clocks are set; false maps each by what came quickest",
    )
    azimuth_sd_deg: float = parameter(2.0, "standard deviation given to bearings", unit="deg", low=0.01, high=30.0)
    silence_s: float = parameter(15.0, "no report for so long is an error", unit="s", low=1.0, high=3600.0)


@dataclass(frozen=True)
class CoarseParameters(NodeParameters):
    """Regions from bearings."""

    period_s: float = parameter(1.0, "time between situations", unit="s", low=0.1, high=60.0, read_only=True)
    detection_range: float = parameter(
        5000.0, "monitors hear so far (paper E, R)", unit="m", low=10.0, high=100_000.0, read_only=True
    )
    communication_range: float = parameter(
        2000.0, "regions so near are neighbours (paper E, r)", unit="m", low=1.0, high=100_000.0, read_only=True
    )
    azimuth_sd_deg: float = parameter(
        2.0, "standard deviation of a bearing", unit="deg", low=0.01, high=30.0, read_only=True
    )
    heard_share: float = parameter(
        0.9, "share of emissions in range that come through", unit="1", low=0.01, high=0.999, read_only=True
    )
    speed: float = parameter(1.0, "of people, root mean square", unit="m/s", low=0.01, high=50.0, read_only=True)
    window_s: float = parameter(65.0, "a report counts for so long", unit="s", low=1.0, high=3600.0, read_only=True)
    lost_after_s: float = parameter(30.0, "silent for so long is LOST", unit="s", low=1.0, high=3600.0, read_only=True)
    forget_after_s: float = parameter(
        300.0, "a region silent for so long is no more", unit="s", low=1.0, high=86_400.0, read_only=True
    )
    wake_reach: float = parameter(100.0, "anchors so far outside of a region are woken", unit="m", low=0.0, high=5000.0)

    def settings(self) -> CoarseSettings:
        """As the positioning takes them."""
        return CoarseSettings(
            detection_range_m=self.detection_range,
            communication_range_m=self.communication_range,
            azimuth_sd_rad=math.radians(self.azimuth_sd_deg),
            heard_share=self.heard_share,
            speed_m_s=self.speed,
            window_s=self.window_s,
            lost_after_s=self.lost_after_s,
            forget_after_s=self.forget_after_s,
        )
