"""Time alignment: everything measured, as epochs of one person each, in order."""

import math
import sys
from collections.abc import Hashable, Iterable
from pathlib import Path
from typing import Any

from mine_loc_interfaces import msg

from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.node_base import NodeBase
from mine_loc_core.nodes.qos import EVENTS
from mine_loc_core.nodes.ros_host import run
from mine_loc_core.people import PeopleFile
from mine_loc_core.site import load_site
from mine_loc_core.stamps import NS_PER_MS, to_ns, to_stamp_ns
from mine_loc_fusion.parameters import SynchroniserParameters
from mine_loc_fusion.synchroniser import Epoch, Kind, Synchroniser, SyncInput

_PEOPLE_PERIOD_S = 1.0


class SynchroniserNode(NodeBase):
    """Joins the streams by person and instant."""

    default_name = "synchroniser"
    parameter_class = SynchroniserParameters

    def configure(self) -> None:
        """Load site and people; a bad file refuses the transition."""
        folder = Path(self.parameters.site)
        self._map_frame = load_site(folder).map_frame
        self._people = PeopleFile(folder)
        self._synchroniser = self._new_synchroniser()
        self._unknown_tags: dict[int, int] = {}
        self._in_other_frames = 0
        self._refused_before: dict[str, int] = {}
        self._epochs = self.publish_to(msg.Epoch, "sync/epochs", EVENTS)
        self._deadline = self.alarm(self._poll)
        self.every(_PEOPLE_PERIOD_S, self._reload_people)
        self.subscribe(msg.UwbRangeArray, "uwb/ranges", self._on_ranges, EVENTS)
        self.subscribe(msg.TdoaArray, "uwb/tdoa", lambda m: self._on_tag(Kind.TDOA, m, m.seq, m.tag_id), EVENTS)
        self.subscribe(msg.UwbPose, "uwb/pose", self._on_pose, EVENTS)
        self.subscribe(msg.LinkStateArray, "uwb/link_state", self._on_link_states, EVENTS)
        self.subscribe(msg.Step, "pdr/steps", lambda m: self._on_person(Kind.STEP, m, m.count), EVENTS)
        self.subscribe(msg.LandmarkFix, "pdr/landmark_fix", lambda m: self._on_person(Kind.LANDMARK, m, 0), EVENTS)
        self.subscribe(
            msg.VelocityChange,
            "pdr/velocity_changes",
            lambda m: self._on_person(Kind.VELOCITY_CHANGE, m, m.count),
            EVENTS,
        )

    def parameters_changed(self) -> None:
        """New limits start with an empty buffer."""
        self._synchroniser = self._new_synchroniser()

    def clock_jumped(self, delta_ns: int) -> None:  # noqa: ARG002
        """Stamps before and after do not belong together."""
        self._synchroniser.reset()
        self._deadline.cancel()

    def health(self) -> Iterable[Health]:
        """Inputs used, late, and refused by cause."""
        synchroniser = self._synchroniser
        refused = {reason.name.lower(): count for reason, count in synchroniser.refused.items()}
        level = Level.WARN if refused != self._refused_before else Level.OK
        self._refused_before = refused
        yield Health("inputs", level, "aligning", {"used": synchroniser.used, "late": synchroniser.late} | refused)
        if self._unknown_tags:
            yield Health("tags", Level.WARN, "tags that nobody in people.yaml wears", self._unknown_tags)
        if self._in_other_frames:
            figures = {"poses": self._in_other_frames}
            yield Health("frames", Level.OK, f"positions that are not in {self._map_frame} are left out", figures)
        if self._people.error:
            yield Health("people.yaml", Level.WARN, self._people.error)

    def _new_synchroniser(self) -> Synchroniser:
        p = self.parameters
        return Synchroniser(
            companion_wait_ns=round(p.companion_wait_ms * NS_PER_MS),
            history_ns=to_ns(p.history_s),
            future_ns=round(p.future_ms * NS_PER_MS),
            max_open=p.max_open,
        )

    def _reload_people(self) -> None:
        before = {person.name for person in self._people.people}
        people = self._people.poll()
        if people is not None:
            for name in before - {person.name for person in people}:
                self._synchroniser.forget(name)
            self._unknown_tags.clear()

    def _on_ranges(self, message: msg.UwbRangeArray) -> None:
        self._on_tag(
            Kind.RANGES, message, message.seq, message.tag_id, message.reporter_id, links=links_received(message)
        )

    def _on_link_states(self, array: msg.LinkStateArray) -> None:
        if array.states:
            first = array.states[0]  # all are of its tag and round
            self._on_tag(Kind.LINK_STATE, array, first.range_seq, first.tag_id, first.anchor_id, size=len(array.states))

    def _on_pose(self, message: msg.UwbPose) -> None:
        if message.header.frame_id == self._map_frame:
            self._on_tag(Kind.UWB_POSE, message, message.seq, message.tag_id)
        else:  # of anchors that ride on a vehicle
            self._in_other_frames += 1

    def _on_tag(self, kind: Kind, message: Any, seq: int, tag_id: int, source: Hashable = 0, **measures: int) -> None:
        person = self._people.people.by_tag(tag_id)
        if person is None:
            if len(self._unknown_tags) < 1024:
                self._unknown_tags[tag_id] = self._unknown_tags.get(tag_id, 0) + 1
            return
        self._push(person.name, kind, (tag_id, source), seq, message, **measures)

    def _on_person(self, kind: Kind, message: Any, seq: int) -> None:
        if self._people.people.by_name(message.person) is not None:
            self._push(message.person, kind, 0, seq, message)

    def _push(self, person: str, kind: Kind, source: Hashable, seq: int, message: Any, **measures: int) -> None:
        item = SyncInput(person, kind, source, seq, to_stamp_ns(message.header.stamp), message, **measures)
        epochs, _ = self._synchroniser.push(item, self.now_ns())
        self._publish(epochs)

    def _poll(self) -> None:
        self._publish(self._synchroniser.poll(self.now_ns()))

    def _publish(self, epochs: Iterable[Epoch]) -> None:
        for epoch in epochs:
            message = msg.Epoch(person=epoch.person, seq=epoch.seq, late=epoch.late)
            message.header.stamp = to_time(epoch.stamp_ns)
            message.header.frame_id = self._map_frame
            for kind, payloads in epoch.inputs.items():
                judged = kind is Kind.LINK_STATE
                setattr(
                    message, kind.value, [one for array in payloads for one in array.states] if judged else payloads
                )
            self._epochs.publish(message)
        deadline_ns = self._synchroniser.next_deadline_ns
        if deadline_ns is None:
            self._deadline.cancel()
        else:
            self._deadline.ring_at(deadline_ns)


def links_received(message: msg.UwbRangeArray) -> int:
    """How many link states a round can get: none of an exchange that failed."""
    return sum(math.isfinite(each.range_raw) for each in message.ranges)


def main() -> int:
    """Entry point."""
    return run(SynchroniserNode)


if __name__ == "__main__":
    sys.exit(main())
