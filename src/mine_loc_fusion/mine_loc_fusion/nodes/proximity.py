"""People near machines: fused poses and vehicles' poses in, alarms and the stop signal out."""

import math
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from geometry_msgs.msg import PoseStamped
from mine_loc_interfaces import msg
from mine_loc_interfaces.srv import Reset

from mine_loc_core.health import Health, Level
from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.node_base import NodeBase
from mine_loc_core.nodes.qos import EVENTS, LATCHED
from mine_loc_core.nodes.ros_host import run
from mine_loc_core.people import PeopleFile
from mine_loc_core.site import load_site
from mine_loc_core.stamps import to_stamp_ns
from mine_loc_fusion.nodes.proximity_messages import to_alarm_array, to_guard_rules, to_pose2, to_seen
from mine_loc_fusion.proximity_guard import ProximityGuard
from mine_loc_fusion.proximity_parameters import ProximityParameters
from mine_loc_fusion.site_zones import guarded_vehicles, proximity_zones, standing_vehicles
from mine_loc_fusion.stop_signal import StopOrder, StopSender

_PERIOD_S = 1.0


class ProximityNode(NodeBase):
    """Watches the zones of a site and tells each vehicle that carries a danger zone whether it may run."""

    default_name = "proximity"
    parameter_class = ProximityParameters

    def configure(self) -> None:
        """Load site and people; a bad file refuses the transition."""
        folder = Path(self.parameters.site)
        site = load_site(folder)
        self._map_frame = site.map_frame
        self._people = PeopleFile(folder)
        self._standing = standing_vehicles(site)
        self._zones = proximity_zones(site)
        self._guard = self._new_guard()
        self._senders = {name: StopSender(self.parameters.valid_for_s) for name in guarded_vehicles(self._zones)}
        self._orders: dict[str, StopOrder] = {}
        self._refused = {"frame": 0, "number": 0}
        self._alarms = self.publish_to(msg.ProximityAlarmArray, "proximity/alarms", LATCHED)
        self._stop = self.publish_to(msg.ProximityStop, "proximity/stop", EVENTS)
        self.serve(Reset, "~/acknowledge", self._acknowledge)
        self.serve(Reset, "~/vouch", self._vouch)
        self.every(self.parameters.heartbeat_s, self._beat)
        self.every(_PERIOD_S, self._each_second)
        self.subscribe(msg.PersonPoseArray, "fused/poses", self._on_poses, EVENTS)
        self.subscribe(msg.FusionHealth, "fused/health", self._on_fusion_health, EVENTS)
        for name in {zone.vehicle for zone in self._zones if zone.vehicle} - self._standing.keys():
            self.subscribe(PoseStamped, f"vehicles/{name}/pose", self._vehicle_callback(name), EVENTS)

    def clock_jumped(self, delta_ns: int) -> None:
        """Ages stay what they were."""
        self._guard.time_jumped(delta_ns)

    def health(self) -> Iterable[Health]:
        """Which vehicle stands and why, and what was refused."""
        for name, order in self._orders.items():
            yield Health(f"stop {name}", Level.WARN if order.stop else Level.OK, order.reason or "may run")
        alarms = self._guard.proximity.alarms()
        latched = sum(alarm.latched for alarm in alarms)
        figures = {"alarms": len(alarms), "latched": latched} | {f"refused_{k}": n for k, n in self._refused.items()}
        yield Health("zones", Level.OK, f"{len(self._zones)} zones", figures)
        if self._people.error:
            yield Health("people.yaml", Level.WARN, self._people.error)

    def _new_guard(self) -> ProximityGuard:
        return ProximityGuard(self._zones, self._standing, to_guard_rules(self.parameters))

    def _on_poses(self, array: msg.PersonPoseArray) -> None:
        if array.header.frame_id != self._map_frame:
            self._refused["frame"] += 1
            return
        if self._guard.take_people([to_seen(person) for person in array.people], self.steady_ns()):
            self._publish_alarms()

    def _on_fusion_health(self, _: msg.FusionHealth) -> None:
        self._guard.take_sign_of_life(self.steady_ns())

    def _vehicle_callback(self, name: str) -> Any:
        def on_pose(message: PoseStamped) -> None:
            pose = to_pose2(message.pose)
            if message.header.frame_id != self._map_frame:
                self._refused["frame"] += 1
            elif not (math.isfinite(pose.x_m) and math.isfinite(pose.y_m) and math.isfinite(pose.yaw_rad)):
                self._refused["number"] += 1
            else:
                self._guard.take_vehicle(name, to_stamp_ns(message.header.stamp), pose)

        return on_pose

    def _beat(self) -> None:
        now_ns, steady_ns = self.now_ns(), self.steady_ns()
        for name, sender in self._senders.items():
            order = self._orders[name] = sender.order(self._guard.stop_reasons(name, now_ns, steady_ns))
            message = msg.ProximityStop(
                vehicle=name,
                stop=order.stop,
                heartbeat=order.heartbeat,
                valid_for=order.valid_for_s,
                reason=order.reason,
            )
            message.header.stamp = to_time(now_ns)
            message.header.frame_id = self._map_frame
            self._stop.publish(message)

    def _each_second(self) -> None:
        before = {person.name for person in self._people.people}
        people = self._people.poll()
        if people is not None:
            self._guard.forget_people(before - {person.name for person in people})
        self._publish_alarms()

    def _publish_alarms(self) -> None:
        self._alarms.publish(to_alarm_array(self._guard.proximity.alarms(), self.now_ns(), self._map_frame))
        self._guard.proximity.published()

    def _acknowledge(self, request: Reset.Request) -> tuple[bool, str]:
        released, kept = self._guard.proximity.acknowledge(request.person)
        self._publish_alarms()
        if kept:
            return False, "still in danger: " + ", ".join(f"{alarm.person} in {alarm.zone_id}" for alarm in kept)
        names = ", ".join(f"{alarm.person} in {alarm.zone_id}" for alarm in released)
        return True, f"acknowledged {names}" if released else "nothing was latched"

    def _vouch(self, request: Reset.Request) -> tuple[bool, str]:
        chosen = self._guard.vouch(request.person, self.now_ns())
        self._publish_alarms()
        if request.person and not chosen:
            return False, f"{request.person!r} is well positioned, or was never heard of"
        return True, f"until they are positioned again, not watched: {', '.join(chosen) or 'nobody'}"


def main() -> int:
    """Entry point."""
    return run(ProximityNode)


if __name__ == "__main__":
    sys.exit(main())
