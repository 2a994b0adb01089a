"""One person's samples against the pseudo-plane: turns found, matched, and a track in the map corrected by them.

The track begins with a pose in the map that somebody gives; before that turns are found and no marker is.
"""

from collections import Counter
from collections.abc import Sequence

from mine_loc_core.stamps import NS_PER_S, to_s
from mine_loc_pdr.dead_reckoning import LONGEST_DT_NS, StepEvent
from mine_loc_pdr.gallery_constraint import GalleryConstraint
from mine_loc_pdr.map_track import MapPose, MapTrack
from mine_loc_pdr.pseudo_plane import LandmarkFix, PseudoPlane
from mine_loc_pdr.turns import TurnDetector

CLOCK_JUMP_NS = NS_PER_S  # a step back by more is a new clock
POSE_AGE_NS = NS_PER_S  # a person does not walk far in it


class PlaneFollower:
    """Push what dead reckoning makes of every sample; returned is what became of a turn."""

    def __init__(self, plane: PseudoPlane, galleries: GalleryConstraint | None = None) -> None:
        self._plane, self._galleries = plane, galleries
        self._turns = TurnDetector()
        self._track: MapTrack | None = None
        self._verdicts: Counter[str] = Counter()
        self._last_ns: int | None = None
        self._heading_rad = 0.0

    @property
    def pose(self) -> MapPose | None:
        """In the map, after the last step; None until one was given, and after a jump of the clock."""
        return None if self._track is None else self._track.pose()

    @property
    def counts(self) -> Counter[str]:
        """Turns by verdict, and what was dropped and why; of the track since its pose was given."""
        headings = Counter({f"heading_{name}": count for name, count in self._turns.faults.items()})
        return self._verdicts + headings + (self._track.faults if self._track else Counter())

    def set_pose(self, pose: MapPose, scale_variance: float, rate_sd_rad_s: float) -> str | None:
        """Begin the track with a pose that holds at the last sample (stamp 0), or did a moment before; or say why not.

        `scale_variance` and `rate_sd_rad_s`: what dead reckoning claims for its step scale and for its heading's drift.
        """
        if self._last_ns is None:
            return "no horizon yet; allowed: after half a second of samples"
        if pose.stamp_ns and abs(pose.stamp_ns - self._last_ns) > POSE_AGE_NS:
            return f"stamp {pose.stamp_ns} is not now; allowed: within 1 s of the last sample, {self._last_ns}, or 0"
        now = MapPose(self._last_ns, pose.x_m, pose.y_m, pose.yaw_rad, pose.covariance)
        self._track = MapTrack(now, self._heading_rad, scale_variance, rate_sd_rad_s, self._plane, self._galleries)
        return None

    def push(self, stamp_ns: int, heading_rad: float, steps: Sequence[StepEvent]) -> LandmarkFix | None:
        """Take the heading in odom at a sample and the steps that were completed with it."""
        self._bridge(stamp_ns)
        turn = self._turns.push(stamp_ns, heading_rad)
        self._heading_rad = heading_rad
        if self._track is None:
            return None
        for step in steps:
            self._track.step(step)
        fix = None if turn is None else self._track.turn(turn)
        if fix is not None:
            self._verdicts[fix.verdict.name.lower()] += 1
        return fix

    def _bridge(self, stamp_ns: int) -> None:
        last_ns, self._last_ns = self._last_ns, stamp_ns
        if last_ns is None:
            return
        if stamp_ns < last_ns - CLOCK_JUMP_NS:
            self._track = None
        elif stamp_ns < last_ns:
            self._last_ns = last_ns
        elif self._track is not None and stamp_ns - last_ns > LONGEST_DT_NS:
            self._track.gap(to_s(stamp_ns - last_ns))
