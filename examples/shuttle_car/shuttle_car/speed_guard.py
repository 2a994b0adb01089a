"""A shuttle car that slows for people: its wanted speed in, what it may drive out.

Other robot software needs mine_loc_interfaces and nothing else of mine_loc. Put this node between what steers the car
(`wanted/cmd_vel`) and its drives (`cmd_vel`):

    ros2 run shuttle_car speed_guard --ros-args -p vehicle:=shuttle_car -p zone:=round_car
"""

import time

import rclpy
from geometry_msgs.msg import Twist
from mine_loc_interfaces.msg import ProximityAlarm, ProximityAlarmArray, ProximityStop
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time

from shuttle_car.speed_limit import SpeedLimit, Speeds

PERIOD_S = 0.05
WANTED_FOR_S = 0.5  # a driver's wish holds no longer


class SpeedGuard(Node):
    """Limits the speed of one vehicle."""

    def __init__(self) -> None:
        super().__init__("speed_guard")
        self._vehicle = self.declare_parameter("vehicle", "shuttle_car").value
        self._zone = self.declare_parameter("zone", "round_car").value
        full = self.declare_parameter("full_speed", 3.0).value
        slow = self.declare_parameter("slow_speed", 0.5).value
        self._limit = SpeedLimit(Speeds(full, slow))
        self._wanted, self._wanted_s = Twist(), float("-inf")
        # Alarms are the state of the moment: transient local gives the last message to whoever comes late.
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._commands = self.create_publisher(Twist, "cmd_vel", 10)
        self.create_subscription(ProximityStop, "proximity/stop", self._on_stop, 10)
        self.create_subscription(ProximityAlarmArray, "proximity/alarms", self._on_alarms, latched)
        self.create_subscription(Twist, "wanted/cmd_vel", self._on_wanted, 10)
        self.create_timer(PERIOD_S, self._drive)

    def _on_stop(self, message: ProximityStop) -> None:
        if message.vehicle == self._vehicle:
            age_s = (self.get_clock().now() - Time.from_msg(message.header.stamp)).nanoseconds / 1e9
            self._limit.take_stop(
                stop=message.stop,
                heartbeat=message.heartbeat,
                valid_for_s=message.valid_for,
                age_s=age_s,
                now_s=time.monotonic(),
            )

    def _on_alarms(self, message: ProximityAlarmArray) -> None:
        # A level this car does not know (a later version's) is above CLEAR, and slows it.
        near = [alarm for alarm in message.alarms if alarm.zone_id == self._zone]
        self._limit.take_alarms(warned=any(alarm.level != ProximityAlarm.CLEAR for alarm in near))

    def _on_wanted(self, message: Twist) -> None:
        self._wanted, self._wanted_s = message, time.monotonic()

    def _drive(self) -> None:
        now_s, command = time.monotonic(), Twist()
        if now_s - self._wanted_s < WANTED_FOR_S:
            command.linear.x = self._limit.limited_m_s(self._wanted.linear.x, now_s)
            command.angular.z = self._wanted.angular.z if command.linear.x else 0.0
        self._commands.publish(command)


def main() -> None:
    """Run until the context ends."""
    rclpy.init()
    rclpy.spin(SpeedGuard())


if __name__ == "__main__":
    main()
