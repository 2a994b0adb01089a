"""What the `tightly_coupled` filter is told of the person and the radio, in physical units."""

import math
from dataclasses import dataclass, field, replace

from mine_loc_fusion.inertial_prediction import InertialSettings
from mine_loc_uwb.tracker_settings import RobustTrackerSettings


def _stepping() -> RobustTrackerSettings:
    """The radio, where steps tell the motion: what is left over of a range is a bias that changes within metres."""
    return RobustTrackerSettings(
        acceleration_density_m2_s3=0.1,
        bias_sd_m=0.09,
        bias_time_s=0.7,
        systematic_sd_m=0.0,
        common_bias_sd_m=0.07,
        common_bias_time_s=1000.0,
        nlos_scale_m=0.8,
        nlos_time_s=5.0,
        nlos_share=0.7,
        judgement_weight=0.15,
        gate=0.999999,
        restart_after_s=math.inf,
    )


def _carried() -> RobustTrackerSettings:
    """The radio of who is carried or stands: as with steps, but what obstructs a link is passed sooner."""
    return replace(_stepping(), nlos_time_s=1.0, bias_time_s=2.0)


@dataclass(frozen=True, slots=True)
class TightlyCoupledSettings:
    """Chosen on the tuning seeds of bench/fusion_scenes; docs/fusion.md says how."""

    stepping: RobustTrackerSettings = field(default_factory=_stepping)
    """Of ranges while steps tell the motion."""
    carried: RobustTrackerSettings = field(default_factory=_carried)
    """Of ranges while there are no steps, but changes of velocity, or a yaw that either told before."""
    alone: RobustTrackerSettings = field(default_factory=lambda: RobustTrackerSettings(restart_after_s=math.inf))
    """Of ranges while they are all there is."""
    inertial: InertialSettings = field(default_factory=InertialSettings)
    step_along_sd: float = 0.07
    """Of a step's length, relative to it, beyond what all steps of the person share."""
    step_across_sd_m: float = 0.04
    turn_density_m2_s3: float = 4.0
    """Of white acceleration within a step round a corner: a right angle at walking speed."""
    scale_sd: float = 0.05
    """Of the step length's error that all steps share, at the start."""
    scale_walk_sd: float = 0.002
    """By which it changes, over a square root of a second."""
    yaw_walk_sd_rad: float = math.radians(0.2)
    """Drift of the odom frame, over a square root of a second."""
    gate_probability: float = 0.9999
    """Share of good steps and places that pass."""
    in_rock_counts_s: float = 10.0
    """Ranges that placed the person in the rock say for so long that they are biased."""
    motion_known_s: float = 1.5
    """A step tells the motion for so long."""
