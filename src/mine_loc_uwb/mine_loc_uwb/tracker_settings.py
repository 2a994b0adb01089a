"""What `robust_tracker` is told of the person and the radio, in physical units."""

import math
from dataclasses import dataclass

import numpy as np

from mine_loc_uwb import tracker_kernel as kernel
from mine_loc_uwb.fix import Array
from mine_loc_uwb.path_loss import PathLoss


@dataclass(frozen=True, slots=True)
class RobustTrackerSettings:
    """The person and the radio in physical units."""

    acceleration_density_m2_s3: float = 0.1
    """Spectral density of white acceleration: people walk steadily; a turn is seen within some rounds."""
    bias_sd_m: float = 0.03
    bias_time_s: float = 100.0
    """Of a link, beyond what is calibrated."""
    systematic_sd_m: float = 0.2
    """What is common to all ranges of a link and no averaging takes away, 0.10 to 0.17 m in sight in four buildings and
    more behind a body (hardware notes D.1, D.4): it goes into what is claimed, through the geometry."""
    common_bias_sd_m: float = 0.05
    common_bias_time_s: float = 100.0
    """Of all links of a tag: its own antenna delay."""
    nlos_scale_m: float = 0.6
    """Mean excess of an obstructed link; 0.3 to 0.9 m were measured in buildings (hardware notes D.1)."""
    nlos_growth_per_db: float = 0.0
    """By how much the logarithm of that mean grows as the received level falls below -92 dBm by 1 dB."""
    nlos_time_s: float = 1.0
    """A walker passes what obstructs a link within some such times."""
    judgement_weight: float = 1.0
    """Share of a judgement's logarithmic odds that counts: a classifier is less sure where it was not trained."""
    nlos_share: float = 0.5
    """Share of links that are obstructed where nothing is known of them."""
    path_loss: PathLoss | None = None
    """Levels help, above all to choose where a blink starts a track; None = they do not."""
    level_sd_db: float = 20.0
    """More than the path loss's shadowing, because that stays for metres."""
    top_speed_m_s: float = 3.0
    first_speed_sd_m_s: float = 1.0
    gate: float = 0.9999
    """Probability that a range within the law passes."""
    reopen_after_s: float = 2.0
    """Most ranges refused for so long: begin anew where they agree."""
    guard_s: float = 10.0
    """So long against all ranges, unanimous, before a place is believed that nobody can have walked to."""
    restart_after_s: float = 30.0
    """After such a silence nothing of the old state counts."""
    max_start_sd_m: float = 5.0
    """A first round that leaves more than this undetermined starts nothing."""

    def noise(self) -> Array:
        """The settings the kernel uses, in its order."""
        values = np.empty(kernel.SETTINGS)
        values[kernel.ACCELERATION] = self.acceleration_density_m2_s3
        values[kernel.BIAS_SD], values[kernel.BIAS_TIME] = self.bias_sd_m, self.bias_time_s
        values[kernel.COMMON_SD], values[kernel.COMMON_TIME] = self.common_bias_sd_m, self.common_bias_time_s
        values[kernel.NLOS_SCALE], values[kernel.NLOS_GROWTH] = self.nlos_scale_m, self.nlos_growth_per_db
        values[kernel.NLOS_TIME] = self.nlos_time_s
        values[kernel.NLOS_SHARE], values[kernel.TOP_SPEED] = self.nlos_share, self.top_speed_m_s
        values[kernel.SYSTEMATIC_SD] = self.systematic_sd_m
        values[kernel.JUDGEMENT_WEIGHT] = self.judgement_weight
        loss = self.path_loss
        values[kernel.LEVEL_1M] = loss.level_1m_dbm if loss else math.nan
        values[kernel.LEVEL_EXPONENT] = loss.exponent if loss else math.nan
        values[kernel.LEVEL_SD] = self.level_sd_db if loss else 0.0
        return values
