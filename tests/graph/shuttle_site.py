"""A site of one shuttle car with a danger zone of 2 m and a warning zone of 5 m, and what the fusion would say."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import yaml
from geometry_msgs.msg import PoseStamped
from graph.observer import Heard, Observer
from mine_loc_interfaces.msg import PersonPose, PersonPoseArray, ProximityAlarm, ProximityAlarmArray, ProximityStop

from mine_loc_core.nodes.conversions import to_time
from mine_loc_core.nodes.qos import EVENTS, LATCHED

PERIOD_S = 0.1
FAR_M, WARNED_M, ENDANGERED_M = 40.0, 6.5, 4.0  # before the middle of a car of 6 m


def write_shuttle_site(folder: Path, *, stands: bool = True, relay_port: str = "") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    site: dict[str, Any] = {
        "schema": 1,
        "name": "made_up",
        "dimensions": 2,
        "tag_height_m": 1.0,
        "vehicles": [{"id": "car", "size_m": [6.0, 2.0, 1.5], "stands": stands}],
        "zones": [{"id": "round_car", "type": "hazard_near", "vehicle": "car", "danger_m": 2.0, "warning_m": 5.0}],
    }
    if relay_port:
        relay = {"name": "brake", "vehicle": "car", "output": "modbus_tcp", "port": relay_port, "unit": 7}
        site["relays"] = [relay]
    (folder / "site.yaml").write_text(yaml.safe_dump(site))
    people = [{"name": name, "tag_id": number, "height_m": 1.75} for number, name in enumerate(("fitter", "miner"), 1)]
    (folder / "people.yaml").write_text(yaml.safe_dump({"schema": 1, "people": people}))
    return folder


class Surroundings:
    """Speaks for the fusion and the car ten times a second, as long as somebody waits; hears what proximity says."""

    def __init__(self, observer: Observer) -> None:
        self._observer = observer
        self._poses = observer.node.create_publisher(PersonPoseArray, "fused/poses", EVENTS)
        self._car = observer.node.create_publisher(PoseStamped, "vehicles/car/pose", EVENTS)
        self.alarms: Heard = observer.listen(ProximityAlarmArray, "proximity/alarms", LATCHED)
        self.stops: Heard = observer.listen(ProximityStop, "proximity/stop")
        self.people: dict[str, tuple[float, int]] = {"fitter": (FAR_M, PersonPose.UWB_PDR)}
        self.silent = False
        self.car_at_m: float | None = None
        self._sent_s = 0.0

    def move(self, x_m: float, mode: int = PersonPose.UWB_PDR, person: str = "fitter") -> None:
        self.people[person] = (x_m, mode)

    def wait_for(self, happened: Callable[[], Any], deadline_s: float = 20.0, what: str = "") -> float:
        def seen() -> Any:
            self._send()
            return happened()

        return self._observer.wait_for(seen, deadline_s, what)

    def wait_until_told(self, reason: str, deadline_s: float = 20.0) -> float:
        """To stop for this reason, or to run where it is empty; the seconds that took."""
        return self.wait_for(lambda: self.reason == reason, deadline_s, f"{reason!r}, last {self.reason!r}")

    @property
    def reason(self) -> str | None:
        """Of the last message; None before the first."""
        last = self.stops.messages[-1] if self.stops.messages else None
        if last is not None:
            assert last.stop == bool(last.reason)
        return None if last is None else last.reason

    @property
    def alarm(self) -> ProximityAlarm | None:
        """The only alarm of the last message."""
        last = self.alarms.messages[-1].alarms if self.alarms.messages else []
        return last[0] if last else None

    def _send(self) -> None:
        if time.monotonic() - self._sent_s < PERIOD_S:
            return
        self._sent_s = time.monotonic()
        now = to_time(time.time_ns())
        if not self.silent:
            array = PersonPoseArray()
            array.header.stamp, array.header.frame_id = now, "map"
            array.people = [self._pose(person, now) for person in self.people]
            self._poses.publish(array)
        if self.car_at_m is not None:
            pose = PoseStamped()
            pose.header.stamp, pose.header.frame_id = now, "map"
            pose.pose.position.x, pose.pose.orientation.w = self.car_at_m, 1.0
            self._car.publish(pose)

    def _pose(self, person: str, now: Any) -> PersonPose:
        x_m, mode = self.people[person]
        message = PersonPose(person=person, stamp=now, mode=mode)
        message.pose.pose.position.x = x_m
        message.pose.covariance[0] = message.pose.covariance[7] = 0.04
        return message
