"""One pose per person: epochs in, poses, transforms, verdicts and health out."""

import math
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from mine_loc_interfaces import msg
from mine_loc_interfaces.srv import Reset, SetPose, ToggleSensor
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.node_base import NodeBase
from mine_loc_core.nodes.qos import EVENTS
from mine_loc_core.nodes.ros_host import run
from mine_loc_core.nodes.verdict_messages import to_verdict_array
from mine_loc_core.people import PeopleFile
from mine_loc_core.site import load_site
from mine_loc_core.stamps import NS_PER_MS, NS_PER_S, to_ns, to_stamp_ns
from mine_loc_core.verdicts import Source
from mine_loc_core.walkable_area import WalkableArea
from mine_loc_fusion.estimate import Estimate, is_position
from mine_loc_fusion.nodes.messages import (
    los_fraction,
    to_inputs,
    to_person_pose,
    to_place,
    to_region,
    to_transform,
)
from mine_loc_fusion.parameters import FusionParameters
from mine_loc_fusion.tightly_coupled import rehearse
from mine_loc_fusion.tracked_person import TrackedPerson
from mine_loc_uwb.range_correction_file import load_range_correction
from mine_loc_uwb.range_intake import RangeIntake

_PERIOD_S = 1.0
_HEALTH_PERIOD_S = 5.0
_TURNS = 4
"""What is done for everybody in turn is shared out, lest a round waits for it."""
_PRESENT = (msg.CoarseRegion.NEW, msg.CoarseRegion.KEPT)
_SOURCES = (Source.RANGE, Source.TDOA, Source.UWB_POSE, Source.STEP, Source.LANDMARK, Source.REGION, Source.IMU)


class Fusion(NodeBase):
    """Runs one estimator a person."""

    default_name = "fusion"
    parameter_class = FusionParameters

    def configure(self) -> None:
        """Load site and people; a bad file refuses the transition."""
        folder = Path(self.parameters.site)
        self._site = load_site(folder)
        self._people = PeopleFile(folder)
        self._served = {name.strip() for name in self.parameters.people.split(",") if name.strip()}
        chosen = self.parameters.range_correction
        correction = load_range_correction(folder / chosen) if chosen else None
        self._area = WalkableArea.of(self._site)
        self._intake = RangeIntake(self._site.fixed_anchors, self.parameters.max_range_m, correction)
        self._tracked: dict[str, TrackedPerson] = {}
        self._pose_publishers: dict[str, object] = {}
        self._array = self.publish_to(msg.PersonPoseArray, "fused/poses", EVENTS)
        self._verdicts = self.publish_to(msg.MeasurementVerdictArray, "fused/verdicts", EVENTS)
        self._health = self.publish_to(msg.FusionHealth, "fused/health", EVENTS)
        self._tf = self.publish_to(TFMessage, "/tf", EVENTS)
        self._take_people()
        self.serve(Reset, "~/reset", self._reset)
        self.serve(SetPose, "~/set_pose", self._set_pose)
        self.serve(ToggleSensor, "~/toggle_sensor", self._toggle_sensor)
        self._turn = self._told = 0
        self.every(self.parameters.coast_period_s / _TURNS, self._coast)
        self.every(_PERIOD_S, self._poll_people)
        self.every(_PERIOD_S / _TURNS, self._tell_health)
        self.subscribe(msg.Epoch, "sync/epochs", self._on_epoch, EVENTS)
        self.subscribe(msg.CoarseRegionArray, "coarse/regions", self._on_regions, EVENTS)

    def activate(self) -> None:
        """Compile what the first epoch would wait for."""
        rehearse(self._site.dimensions, self._area)

    def parameters_changed(self) -> None:
        """New parameters start new estimators."""
        self._tracked.clear()
        self._take_people()

    def clock_jumped(self, delta_ns: int) -> None:  # noqa: ARG002
        """Estimates rest on stamps that no longer hold."""
        self._intake.reset()
        for tracked in self._tracked.values():
            tracked.reset()

    def health(self) -> Iterable[Health]:
        """How many people are positioned."""
        now_ns = self.now_ns()
        modes = {name: tracked.mode(now_ns).name for name, tracked in self._tracked.items()}
        yield Health("people", Level.OK, f"{len(modes)} people", modes)
        if self._people.error:
            yield Health("people.yaml", Level.WARN, self._people.error)

    def _take_people(self) -> None:
        people = self._people.people
        for name in [name for name in self._tracked if people.by_name(name) is None]:
            self._intake.forget(self._tracked.pop(name).person.tag_id)
            self.release(self._pose_publishers.pop(name))
        solved_height_m = self._site.tag_height_m if self._site.dimensions == 3 else None
        for person in people:
            if self._served and person.name not in self._served:
                continue
            tracked = self._tracked.get(person.name)
            if tracked is None:
                self._tracked[person.name] = TrackedPerson(person, self.parameters, solved_height_m, self._area)
            else:
                tracked.person = person
            if person.name not in self._pose_publishers:
                topic = f"people/{person.name}/pose"
                self._pose_publishers[person.name] = self.publish_to(PoseWithCovarianceStamped, topic, EVENTS)

    def _on_epoch(self, epoch: msg.Epoch) -> None:
        tracked = self._tracked.get(epoch.person)
        if tracked is None:
            return
        started_ns = self.steady_ns()
        height_m = None if self._site.dimensions == 3 else self._height_m(tracked)
        inputs, refused = to_inputs(epoch, self._intake, height_m, self.parameters.arrival_sd_m**2)
        verdicts = refused + tracked.update(inputs, late=epoch.late)
        tracked.costs_s.append((self.steady_ns() - started_ns) / NS_PER_S)
        if epoch.ranges:
            tracked.los_fraction = los_fraction(epoch)
        if epoch.steps:
            position = epoch.steps[-1].position
            tracked.odom_position_m = (position.x, position.y, position.z)
        if verdicts and self._verdicts.get_subscription_count():
            stamp, frame = epoch.header.stamp, self._site.map_frame
            self._verdicts.publish(to_verdict_array(verdicts, stamp, frame, person=epoch.person))
        if not epoch.late:
            self._publish([tracked], inputs.stamp_ns)

    def _on_regions(self, regions: msg.CoarseRegionArray) -> None:
        """A region places a person of whom nothing better is known, and bounds one who has been silent for long."""
        for region in regions.regions:
            tracked = self._tracked.get(region.person)
            if tracked is None or region.status not in _PRESENT:
                continue
            stamp_ns = to_stamp_ns(regions.header.stamp)
            verdicts = tracked.use_region(stamp_ns, to_region(region))
            if verdicts:
                array = to_verdict_array(verdicts, regions.header.stamp, self._site.map_frame, person=region.person)
                self._verdicts.publish(array)
                self._publish([tracked], stamp_ns)

    def _coast(self) -> None:
        """Whoever was not heard of lately is published from prediction, so that the output never stops."""
        now_ns = self.now_ns()
        silent_ns = to_ns(self.parameters.coast_period_s)
        self._publish(
            [t for t in self._tracked.values() if t.published_ns is not None and now_ns - t.published_ns > silent_ns],
            now_ns,
        )

    def _publish(self, people: Iterable[TrackedPerson], stamp_ns: int) -> None:
        outputs = [(tracked, estimate) for tracked in people if (estimate := tracked.output(stamp_ns))]
        if not outputs:
            return
        array = msg.PersonPoseArray(instance=self.parameters.instance)
        array.header.frame_id = self._site.map_frame
        array.header.stamp = to_time(max(estimate.stamp_ns for _, estimate in outputs))
        transforms, follow = TFMessage(), self._tf.get_subscription_count()
        for tracked, estimate in outputs:
            person = tracked.person
            height_m = self._height_m(tracked) if estimate.height_m is None else estimate.height_m
            mode = tracked.mode_of(estimate)
            pose = to_person_pose(person.name, person.tag_id, estimate, height_m, tracked.los_fraction, mode)
            array.people.append(pose)
            publisher = self._pose_publishers[person.name]
            if publisher.get_subscription_count():
                stamped = PoseWithCovarianceStamped(pose=pose.pose)
                stamped.header = Header(stamp=pose.stamp, frame_id=self._site.map_frame)
                publisher.publish(stamped)
            if follow:
                transforms.transforms.extend(self._transforms(tracked, estimate))
        self._array.publish(array)
        if follow:
            self._tf.publish(transforms)

    def _transforms(self, tracked: TrackedPerson, estimate: Estimate) -> Iterable:
        """map → odom, placed so that odom → base_link (of dead reckoning) ends at the estimate (REP 105)."""
        name = tracked.person.name
        yaw = estimate.yaw_offset_rad or 0.0
        ox, oy, oz = tracked.odom_position_m
        x = float(estimate.position_m[0]) - (math.cos(yaw) * ox - math.sin(yaw) * oy)
        y = float(estimate.position_m[1]) - (math.sin(yaw) * ox + math.cos(yaw) * oy)
        z = self._height_m(tracked) - oz
        yield to_transform(self._site.map_frame, f"{name}/odom", estimate.stamp_ns, x, y, z, yaw)
        if tracked.person.n100 is None:  # nobody dead-reckons: the tree is completed here
            yield to_transform(f"{name}/odom", f"{name}/base_link", estimate.stamp_ns, 0.0, 0.0, 0.0, 0.0)

    def _height_m(self, tracked: TrackedPerson) -> float:
        height_m = tracked.person.tag_height_m
        return self._site.tag_height_m if height_m is None else height_m

    def _poll_people(self) -> None:
        if self._people.poll() is not None:
            self._take_people()

    def _tell_health(self) -> None:
        """Of some of the people in turn: all at once would keep the next round waiting."""
        if not self._health.get_subscription_count():
            return
        now_ns, names = self.now_ns(), list(self._tracked)
        a_second = math.ceil(len(names) * _PERIOD_S / _HEALTH_PERIOD_S)
        before, self._turn = self._turn, (self._turn + 1) % _TURNS
        for _ in range(a_second * (before + 1) // _TURNS - a_second * before // _TURNS):
            self._told = (self._told + 1) % len(names)
            name = names[self._told]
            self._health.publish(self._to_health(name, self._tracked[name], now_ns))

    def _to_health(self, name: str, tracked: TrackedPerson, now_ns: int) -> msg.FusionHealth:
        costs = np.percentile(tracked.costs_s, [50, 99]) if tracked.costs_s else (0.0, 0.0)
        by_reason = np.zeros(32, dtype=np.uint64)
        for reason, count in tracked.reasons.items():
            by_reason[int(reason)] = count
        accepted = int(by_reason[msg.MeasurementVerdict.ACCEPTED])
        by_reason[msg.MeasurementVerdict.ACCEPTED] = 0
        message = msg.FusionHealth(
            person=name,
            mode=int(tracked.mode(now_ns)),
            epochs=tracked.epochs,
            late_epochs=tracked.late_epochs,
            accepted=accepted,
            rejected=int(by_reason.sum()),
            processing_p50=float(costs[0]),
            processing_p99=float(costs[1]),
            nis=tracked.nis,
        )
        message.rejected_by_reason = by_reason
        message.header.stamp = to_time(now_ns)
        message.header.frame_id = self._site.map_frame
        return message

    def _set_pose(self, request: SetPose.Request) -> tuple[bool, str]:
        tracked = self._tracked.get(request.person)
        if tracked is None:
            return False, f"nobody called {request.person!r}; known: {', '.join(self._tracked)}"
        frame, stamp_ns = request.pose.header.frame_id, to_stamp_ns(request.pose.header.stamp)
        if frame != self._site.map_frame:
            return False, f"frame {frame!r}; allowed: {self._site.map_frame}"
        position_m, covariance_m2 = to_place(request.pose.pose)
        if not is_position(position_m, covariance_m2):
            return False, "pose: not a place with a covariance; allowed: finite, positive definite in x and y"
        now_ns, most_ms = self.now_ns(), self.parameters.future_ms
        if stamp_ns > now_ns + round(most_ms * NS_PER_MS):
            ahead_ms = (stamp_ns - now_ns) / NS_PER_MS
            return False, f"stamp {ahead_ms:.0f} ms ahead of now; allowed: {most_ms:g} ms (future_ms)"
        tracked.begin(stamp_ns or now_ns, position_m, covariance_m2, None)
        self._publish([tracked], now_ns)
        return True, f"{request.person} is at {position_m[0]:.2f}, {position_m[1]:.2f}"

    def _toggle_sensor(self, request: ToggleSensor.Request) -> tuple[bool, str]:
        if request.person and request.person not in self._tracked:
            return False, f"nobody called {request.person!r}; known: {', '.join(self._tracked)}"
        if request.source not in _SOURCES:
            return False, f"source {request.source}; allowed: {', '.join(f'{s.value} {s.name}' for s in _SOURCES)}"
        source = Source(request.source)
        for tracked in [self._tracked[request.person]] if request.person else self._tracked.values():
            (tracked.disabled.discard if request.enabled else tracked.disabled.add)(source)
        return True, f"{source.name} is {'used' if request.enabled else 'left out'}"

    def _reset(self, request: Reset.Request) -> tuple[bool, str]:
        if request.person and request.person not in self._tracked:
            return False, f"nobody called {request.person!r}; known: {', '.join(self._tracked)}"
        chosen = [request.person] if request.person else list(self._tracked)
        for name in chosen:
            self._tracked[name].reset()
        return True, f"forgot {', '.join(chosen)}"


def main() -> int:
    """Entry point."""
    return run(Fusion)


if __name__ == "__main__":
    sys.exit(main())
