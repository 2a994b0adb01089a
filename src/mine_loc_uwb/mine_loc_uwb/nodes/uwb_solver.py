"""Positions from ranging rounds, and a verdict on every range."""

import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from mine_loc_interfaces.msg import (
    Anchor,
    AnchorMap,
    LinkState,
    LinkStateArray,
    MeasurementVerdictArray,
    TdoaArray,
    UwbPose,
    UwbRangeArray,
)
from mine_loc_interfaces.srv import SetAnchorEnabled

from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.conversions import to_point, to_time
from mine_loc_core.nodes.node_base import NodeBase
from mine_loc_core.nodes.qos import EVENTS, LATCHED
from mine_loc_core.nodes.ros_host import run
from mine_loc_core.nodes.verdict_messages import to_verdict_array
from mine_loc_core.people import PeopleFile
from mine_loc_core.site import load_site
from mine_loc_core.stamps import NS_PER_S, to_stamp_ns
from mine_loc_core.verdicts import Verdict
from mine_loc_uwb.anchor_frame import anchor_frame
from mine_loc_uwb.fix import Fix, FixStatus
from mine_loc_uwb.nodes.solver_messages import measured_arrivals, measured_ranges, to_pose
from mine_loc_uwb.parameters import UwbSolverParameters
from mine_loc_uwb.range_correction_file import load_range_correction
from mine_loc_uwb.round_solver import RoundSolver, rehearse

_PERIOD_S = 1.0
_FORGET_AFTER_NS = 60 * NS_PER_S


class UwbSolver(NodeBase):
    """Solves each round and each blink as it comes."""

    default_name = "uwb_solver"
    parameter_class = UwbSolverParameters

    def configure(self) -> None:
        """Load site, people and range correction; a bad file refuses the transition."""
        folder = Path(self.parameters.site)
        self._site = load_site(folder)
        self._frame = anchor_frame(self._site, self.parameters.frame)
        self._people = PeopleFile(folder)
        chosen = self.parameters.range_correction
        correction = load_range_correction(folder / chosen) if chosen else None
        self._solver = RoundSolver(self._frame.anchors, self.parameters, correction)
        self._poses = self.publish_to(UwbPose, "uwb/pose", EVENTS)
        self._verdicts = self.publish_to(MeasurementVerdictArray, "uwb/verdicts", EVENTS)
        self._map = self.publish_to(AnchorMap, "uwb/anchors", LATCHED)
        self._map_version = 0
        self._rounds = self._fixes = 0
        self._refused: Counter[str] = Counter()
        self._heard_ns: dict[int, int] = {}
        self.serve(SetAnchorEnabled, "~/set_anchor_enabled", self._set_anchor_enabled)
        self.every(_PERIOD_S, self._each_second)
        self.subscribe(UwbRangeArray, "uwb/ranges", self._on_round, EVENTS)
        self.subscribe(TdoaArray, "uwb/tdoa", self._on_blink, EVENTS)
        self.subscribe(LinkStateArray, "uwb/link_state", self._on_link_states, EVENTS)

    def activate(self) -> None:
        """Tell the map, and compile what the first round would wait for."""
        rehearse(self.parameters, self._site.dimensions)
        self._publish_map()

    def parameters_changed(self) -> None:
        """The solver takes new methods and limits at once."""
        self._solver.parameters = self.parameters

    def clock_jumped(self, delta_ns: int) -> None:  # noqa: ARG002
        """Stamps before and after do not belong together."""
        self._solver.reset()

    def health(self) -> Iterable[Health]:
        """How many rounds gave a position, and what was refused."""
        figures: dict[str, object] = {"rounds": self._rounds, "fixes": self._fixes}
        figures["disabled_anchors"] = sorted(self._solver.intake.disabled)
        figures |= {f"refused_{reason}": count for reason, count in sorted(self._refused.items())}
        yield Health("solver", Level.OK, self.parameters.method, figures)
        if self._people.error:
            yield Health("people.yaml", Level.WARN, self._people.error)

    def _each_second(self) -> None:
        self._people.poll()
        before_ns = self.steady_ns() - _FORGET_AFTER_NS
        for tag_id in [tag_id for tag_id, heard_ns in self._heard_ns.items() if heard_ns < before_ns]:
            del self._heard_ns[tag_id]
            self._solver.forget(tag_id)

    def _on_round(self, array: UwbRangeArray) -> None:
        stamp_ns, height_m = to_stamp_ns(array.header.stamp), self._height_m(array.tag_id)
        found = self._solver.solve(array.tag_id, stamp_ns, self.now_ns(), measured_ranges(array), height_m)
        self._publish(*found, array, self.parameters.method)

    def _on_blink(self, array: TdoaArray) -> None:
        stamp_ns, height_m = to_stamp_ns(array.header.stamp), self._height_m(array.tag_id)
        variance_m2 = self.parameters.arrival_sd_m**2
        arrivals = measured_arrivals(array, variance_m2)
        found = self._solver.solve_blink(array.tag_id, stamp_ns, self.now_ns(), arrivals, height_m)
        self._publish(*found, array, self.parameters.tdoa_method)

    def _on_link_states(self, array: LinkStateArray) -> None:
        stamp_ns = to_stamp_ns(array.header.stamp)
        for state in array.states:
            if state.method != LinkState.METHOD_POWER_RULE:  # the range brings what its powers say
                self._solver.intake.link_state(state.tag_id, state.anchor_id, stamp_ns, state.los_probability)

    def _publish(
        self, fix: Fix | None, verdicts: tuple[Verdict, ...], array: UwbRangeArray | TdoaArray, method: str
    ) -> None:
        self._heard_ns[array.tag_id] = self.steady_ns()
        self._rounds += 1
        refused = [verdict.reason.name.lower() for verdict in verdicts if not verdict.accepted]
        self._refused.update(refused)
        if fix is not None:
            self._fixes += fix.status is FixStatus.OK
            self._poses.publish(to_pose(fix, array, self._frame.name, method, len(refused)))
        if self._verdicts.get_subscription_count():
            judged = to_verdict_array(verdicts, array.header.stamp, self._frame.name, tag_id=array.tag_id)
            self._verdicts.publish(judged)

    def _height_m(self, tag_id: int) -> float | None:
        if self._site.dimensions == 3:
            return None
        person = self._people.people.by_tag(tag_id)
        if person is None or person.tag_height_m is None:
            return self._site.tag_height_m
        return person.tag_height_m

    def _set_anchor_enabled(self, request: SetAnchorEnabled.Request) -> tuple[bool, str]:
        if request.anchor_id not in self._solver.intake.anchors:
            return False, f"no anchor {request.anchor_id}; known: {sorted(self._solver.intake.anchors)}"
        (self._solver.intake.disabled.discard if request.enabled else self._solver.intake.disabled.add)(
            request.anchor_id
        )
        self._publish_map()
        return True, f"anchor {request.anchor_id} is {'used' if request.enabled else 'left out'}"

    def _publish_map(self) -> None:
        self._map_version += 1
        message = AnchorMap(map_version=self._map_version)
        message.header.stamp = to_time(self.now_ns())
        message.header.frame_id = self._frame.name
        for anchor in self._frame.anchors:
            variance = anchor.position_sd_m**2
            message.anchors.append(
                Anchor(
                    anchor_id=anchor.id,
                    name=anchor.name,
                    position=to_point(anchor.position_m),
                    position_covariance=[variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance],
                    range_offset=anchor.range_offset_m,
                    enabled=anchor.id not in self._solver.intake.disabled,
                )
            )
        self._map.publish(message)


def main() -> int:
    """Entry point."""
    return run(UwbSolver)


if __name__ == "__main__":
    sys.exit(main())
