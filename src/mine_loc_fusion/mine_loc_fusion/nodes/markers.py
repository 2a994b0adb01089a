"""The live map for RViz and Foxglove: the place once, people and vehicles as they move."""

import math
import sys
import time
from pathlib import Path

from geometry_msgs.msg import Point, PoseStamped
from mine_loc_interfaces.msg import PersonPoseArray
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from mine_loc_core.nodes.conversions import to_point, to_time
from mine_loc_core.nodes.node_base import NodeBase
from mine_loc_core.nodes.qos import EVENTS, LATCHED
from mine_loc_core.nodes.ros_host import run
from mine_loc_core.site import load_site
from mine_loc_core.stamps import to_ns
from mine_loc_fusion.map_drawing import Drawing, draw_person, draw_site, draw_vehicles, draw_zones
from mine_loc_fusion.nodes.proximity_messages import to_pose2, to_seen
from mine_loc_fusion.possible_presence import SeenPerson
from mine_loc_fusion.proximity_parameters import MarkersParameters
from mine_loc_fusion.site_zones import proximity_zones, standing_vehicles

_KINDS = {"box": Marker.CUBE, "cylinder": Marker.CYLINDER, "line": Marker.LINE_STRIP, "text": Marker.TEXT_VIEW_FACING}
_SHOWN_S = 1.0  # a drawing that is not repeated vanishes, so that no frozen map passes for a live one


class Markers(NodeBase):
    """Draws while somebody looks."""

    default_name = "markers"
    parameter_class = MarkersParameters

    def configure(self) -> None:
        """Load the site and draw it; a bad file refuses the transition."""
        self._site = load_site(Path(self.parameters.site))
        self._zones = proximity_zones(self._site)
        self._vehicles = standing_vehicles(self._site)
        self._seen: dict[str, tuple[int, SeenPerson, float]] = {}
        self._place = self.publish_to(MarkerArray, "map/markers", LATCHED)
        self._moving = self.publish_to(MarkerArray, "people/markers", EVENTS)
        self.subscribe(PersonPoseArray, "fused/poses", self._on_poses, EVENTS)
        for vehicle in self._site.vehicles:
            if not vehicle.stands:
                self.subscribe(PoseStamped, f"vehicles/{vehicle.id}/pose", self._vehicle_callback(vehicle.id), EVENTS)
        self.every(self.parameters.period_s, self._draw)

    def activate(self) -> None:
        """Draw what does not move, for whoever comes later."""
        self._place.publish(self._to_array(draw_site(self._site, self._zones), 0.0))

    def _on_poses(self, array: PersonPoseArray) -> None:
        if array.header.frame_id == self._site.map_frame:
            for person in array.people:
                self._seen[person.person] = time.monotonic_ns(), to_seen(person), person.pose.pose.position.z

    def _vehicle_callback(self, name: str) -> object:
        def on_pose(message: PoseStamped) -> None:
            pose = to_pose2(message.pose)
            if message.header.frame_id == self._site.map_frame and math.isfinite(pose.x_m + pose.y_m + pose.yaw_rad):
                self._vehicles[name] = pose

        return on_pose

    def _draw(self) -> None:
        now_ns = time.monotonic_ns()
        self._seen = {name: each for name, each in self._seen.items() if now_ns - each[0] < to_ns(_SHOWN_S)}
        if not self._moving.get_subscription_count():
            return
        drawings = [shape for _, seen, z_m in self._seen.values() for shape in draw_person(seen, z_m)]
        drawings += draw_vehicles(self._site, self._vehicles)
        drawings += draw_zones(tuple(zone for zone in self._zones if zone.vehicle), self._vehicles)
        self._moving.publish(self._to_array(drawings, _SHOWN_S))

    def _to_array(self, drawings: object, shown_s: float) -> MarkerArray:
        stamp = to_time(self.now_ns())
        numbers: dict[str, int] = {}
        markers = []
        for drawing in drawings:
            numbers[drawing.group] = numbers.get(drawing.group, -1) + 1
            marker = to_marker(drawing, numbers[drawing.group], shown_s)
            marker.header.frame_id, marker.header.stamp = self._site.map_frame, stamp
            markers.append(marker)
        return MarkerArray(markers=markers)


def to_marker(drawing: Drawing, number: int, shown_s: float) -> Marker:
    """A marker that vanishes after `shown_s`, 0 = never."""
    marker = Marker(ns=drawing.group, id=number, type=_KINDS[drawing.kind], action=Marker.ADD, text=drawing.text)
    marker.pose.position = to_point(drawing.position_m)
    marker.pose.orientation.z, marker.pose.orientation.w = math.sin(drawing.yaw_rad / 2), math.cos(drawing.yaw_rad / 2)
    marker.scale.x, marker.scale.y, marker.scale.z = (float(size) for size in drawing.size_m)
    red, green, blue, alpha = drawing.colour
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=alpha)
    marker.lifetime.sec, marker.lifetime.nanosec = divmod(to_ns(shown_s), 10**9)
    if drawing.points_m is not None:
        marker.points = [Point(x=float(x), y=float(y), z=float(z)) for x, y, z in drawing.points_m]
    return marker


def main() -> int:
    """Entry point."""
    return run(Markers)


if __name__ == "__main__":
    sys.exit(main())
