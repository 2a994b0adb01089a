// A shuttle car that slows for people: its wanted speed in, what it may drive out.
//
// Other robot software needs mine_loc_interfaces and nothing else of mine_loc. Put this node between what steers the
// car (`wanted/cmd_vel`) and its drives (`cmd_vel`).

#include <algorithm>
#include <chrono>
#include <memory>
#include <string>

#include "geometry_msgs/msg/twist.hpp"
#include "mine_loc_interfaces/msg/proximity_alarm_array.hpp"
#include "mine_loc_interfaces/msg/proximity_stop.hpp"
#include "rclcpp/rclcpp.hpp"
#include "speed_limit.hpp"

using geometry_msgs::msg::Twist;
using mine_loc_interfaces::msg::ProximityAlarm;
using mine_loc_interfaces::msg::ProximityAlarmArray;
using mine_loc_interfaces::msg::ProximityStop;
using namespace std::chrono_literals;

namespace shuttle_car
{

constexpr double kWantedForS = 0.5;  // a driver's wish holds no longer

double steady_s()
{
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

class SpeedGuard : public rclcpp::Node
{
public:
  SpeedGuard()
  : Node("speed_guard"),
    vehicle_(declare_parameter("vehicle", "shuttle_car")),
    zone_(declare_parameter("zone", "round_car")),
    limit_(declare_parameter("full_speed", 3.0), declare_parameter("slow_speed", 0.5))
  {
    // Alarms are the state of the moment: transient local gives the last message to whoever comes late.
    const auto latched = rclcpp::QoS(1).transient_local();
    commands_ = create_publisher<Twist>("cmd_vel", 10);
    stops_ = create_subscription<ProximityStop>(
      "proximity/stop", 10, [this](const ProximityStop & message) { on_stop(message); });
    alarms_ = create_subscription<ProximityAlarmArray>(
      "proximity/alarms", latched, [this](const ProximityAlarmArray & message) { on_alarms(message); });
    wishes_ = create_subscription<Twist>("wanted/cmd_vel", 10, [this](const Twist & message) {
      wanted_ = message;
      wanted_s_ = steady_s();
    });
    timer_ = create_wall_timer(50ms, [this]() { drive(); });
  }

private:
  void on_stop(const ProximityStop & message)
  {
    if (message.vehicle != vehicle_) {
      return;
    }
    const double age_s = (now() - rclcpp::Time(message.header.stamp, get_clock()->get_clock_type())).seconds();
    limit_.take_stop(message.stop, message.heartbeat, message.valid_for, age_s, steady_s());
  }

  void on_alarms(const ProximityAlarmArray & message)
  {
    // A level this car does not know (a later version's) is not CLEAR, and slows it.
    limit_.take_alarms(std::any_of(message.alarms.begin(), message.alarms.end(), [this](const ProximityAlarm & alarm) {
      return alarm.zone_id == zone_ && alarm.level != ProximityAlarm::CLEAR;
    }));
  }

  void drive()
  {
    Twist command;
    if (steady_s() - wanted_s_ < kWantedForS) {
      command.linear.x = limit_.limited_m_s(wanted_.linear.x, steady_s());
      command.angular.z = command.linear.x != 0.0 ? wanted_.angular.z : 0.0;
    }
    commands_->publish(command);
  }

  std::string vehicle_;
  std::string zone_;
  SpeedLimit limit_;
  Twist wanted_;
  double wanted_s_ = -1e9;
  rclcpp::Publisher<Twist>::SharedPtr commands_;
  rclcpp::Subscription<ProximityStop>::SharedPtr stops_;
  rclcpp::Subscription<ProximityAlarmArray>::SharedPtr alarms_;
  rclcpp::Subscription<Twist>::SharedPtr wishes_;
  rclcpp::TimerBase::SharedPtr timer_;
};

}  // namespace shuttle_car

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<shuttle_car::SpeedGuard>());
  rclcpp::shutdown();
  return 0;
}
