"""Positions from ranging rounds, and a verdict on every range."""

import math
import sys
import time
from collections.abc import Iterable
from pathlib import Path

from geometry_msgs.msg import PoseWithCovariance
from mine_loc_interfaces.msg import Anchor, AnchorMap, MeasurementVerdictArray, UwbPose, UwbRangeArray
from mine_loc_interfaces.srv import SetAnchorEnabled

from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.conversions import to_point
from mine_loc_core.nodes.node_base import NodeBase, run
from mine_loc_core.nodes.qos import EVENTS, LATCHED
from mine_loc_core.nodes.verdict_messages import to_verdict_array
from mine_loc_core.people import PeopleFile
from mine_loc_core.site import load_site
from mine_loc_uwb.fix import Fix, FixStatus
from mine_loc_uwb.parameters import UwbSolverParameters
from mine_loc_uwb.round_solver import MeasuredRange, RoundSolver

_PERIOD_S = 1.0
_FORGET_AFTER_S = 60.0


class UwbSolver(NodeBase):
    """Solves each round as it comes."""

    parameter_class = UwbSolverParameters

    def __init__(self) -> None:
        super().__init__("uwb_solver")

    def configure(self) -> None:
        """Load site and people; a bad file refuses the transition."""
        folder = Path(self.parameters.site)
        self._site = load_site(folder)
        self._people = PeopleFile(folder)
        self._solver = RoundSolver(self._site.anchors, self.parameters)
        self._poses = self.publish_to(UwbPose, "uwb/pose", EVENTS)
        self._verdicts = self.publish_to(MeasurementVerdictArray, "uwb/verdicts", EVENTS)
        self._map = self.publish_to(AnchorMap, "uwb/anchors", LATCHED)
        self._map_version = 0
        self._rounds = self._fixes = 0
        self._heard_s: dict[int, float] = {}
        self.serve(SetAnchorEnabled, "~/set_anchor_enabled", self._set_anchor_enabled)
        self.every(_PERIOD_S, self._each_second)
        self.subscribe(UwbRangeArray, "uwb/ranges", self._on_round, EVENTS)

    def activate(self) -> None:
        """Tell the map."""
        self._publish_map()

    def parameters_changed(self) -> None:
        """The solver takes new limits at once."""
        self._solver.parameters = self.parameters

    def health(self) -> Iterable[Health]:
        """How many rounds gave a position."""
        figures = {"rounds": self._rounds, "fixes": self._fixes, "disabled_anchors": sorted(self._solver.disabled)}
        yield Health("solver", Level.OK, self.parameters.method, figures)
        if self._people.error:
            yield Health("people.yaml", Level.WARN, self._people.error)

    def _each_second(self) -> None:
        self._people.poll()
        now_s = time.monotonic()
        for tag_id in [tag_id for tag_id, heard_s in self._heard_s.items() if now_s - heard_s > _FORGET_AFTER_S]:
            del self._heard_s[tag_id]
            self._solver.forget(tag_id)

    def _on_round(self, array: UwbRangeArray) -> None:
        ranges = [MeasuredRange(item.anchor_id, item.range, item.range_variance) for item in array.ranges]
        fix, verdicts = self._solver.solve(array.tag_id, ranges, self._height_m(array.tag_id))
        self._heard_s[array.tag_id] = time.monotonic()
        self._rounds += 1
        self._fixes += fix.status is FixStatus.OK
        rejected = sum(not verdict.accepted for verdict in verdicts)
        self._poses.publish(_to_pose(fix, array, self._site.map_frame, self.parameters.method, rejected))
        self._verdicts.publish(
            to_verdict_array(verdicts, array.header.stamp, self._site.map_frame, tag_id=array.tag_id)
        )

    def _height_m(self, tag_id: int) -> float | None:
        if self._site.dimensions == 3:
            return None
        person = self._people.people.by_tag(tag_id)
        if person is None or person.tag_height_m is None:
            return self._site.tag_height_m
        return person.tag_height_m

    def _set_anchor_enabled(self, request: SetAnchorEnabled.Request) -> tuple[bool, str]:
        if request.anchor_id not in self._solver.anchors:
            return False, f"no anchor {request.anchor_id}; known: {sorted(self._solver.anchors)}"
        (self._solver.disabled.discard if request.enabled else self._solver.disabled.add)(request.anchor_id)
        self._publish_map()
        return True, f"anchor {request.anchor_id} is {'used' if request.enabled else 'left out'}"

    def _publish_map(self) -> None:
        self._map_version += 1
        message = AnchorMap(map_version=self._map_version)
        message.header.stamp = self.get_clock().now().to_msg()
        message.header.frame_id = self._site.map_frame
        for anchor in self._site.anchors:
            variance = anchor.position_sd_m**2
            message.anchors.append(
                Anchor(
                    anchor_id=anchor.id,
                    name=anchor.name,
                    position=to_point(anchor.position_m),
                    position_covariance=[variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance],
                    range_offset=anchor.range_offset_m,
                    enabled=anchor.id not in self._solver.disabled,
                )
            )
        self._map.publish(message)


def _to_pose(fix: Fix, array: UwbRangeArray, frame_id: str, method: str, rejected: int) -> UwbPose:
    pose = PoseWithCovariance()
    pose.pose.position = to_point(fix.position_m)
    pose.pose.orientation.w = 1.0
    covariance = [0.0] * 36
    for row in range(3):
        for column in range(3):
            covariance[6 * row + column] = float(fix.covariance_m2[row, column])
    for index in (21, 28, 35):
        covariance[index] = -1.0
    pose.covariance = covariance
    message = UwbPose(
        tag_id=array.tag_id,
        seq=array.seq,
        pose=pose,
        method=method,
        dimensions=fix.dimensions,
        ranges_used=min(fix.ranges_used, 255),
        ranges_rejected=min(rejected, 255),
        residual_rms=fix.residual_rms_m,
        gdop=fix.gdop if math.isfinite(fix.gdop) else math.inf,
        status=int(fix.status),
    )
    message.header.stamp = array.header.stamp
    message.header.frame_id = frame_id
    return message


def main() -> int:
    """Entry point."""
    return run(UwbSolver)


if __name__ == "__main__":
    sys.exit(main())
