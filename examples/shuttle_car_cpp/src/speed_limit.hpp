// How fast a shuttle car may drive, from what mine_loc says of the people near it. No ROS in here.
//
// It needs a permission to move at all, and that runs out: what is not heard is a reason to stop.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

namespace shuttle_car
{

class SpeedLimit
{
public:
  // Metres a second: with nobody near, and with somebody in the warning zone.
  SpeedLimit(double full, double slow) : full_(full), slow_(slow) {}

  // A message of proximity/stop for this vehicle, `age_s` old when it arrived at `now_s` of a steady clock.
  void take_stop(bool stop, std::uint32_t heartbeat, double valid_for_s, double age_s, double now_s)
  {
    const std::uint32_t gone_on = heartbeat - heartbeat_.value_or(heartbeat);  // modulo 2^32
    heartbeat_ = heartbeat;
    const bool beats = gone_on >= 1 && gone_on <= kMostLost;
    const bool good = !stop && beats && std::abs(age_s) <= valid_for_s;
    permitted_until_s_ = good ? now_s + valid_for_s - std::max(age_s, 0.0) : kNever;
  }

  // A message of proximity/alarms: whether anybody is in a zone of this vehicle.
  void take_alarms(bool warned) { warned_ = warned; }

  // The wanted speed, forward or backward, as far as it is allowed now [m/s].
  double limited_m_s(double wanted_m_s, double now_s) const
  {
    const double limit = warned_ ? slow_ : full_;
    if (!(now_s <= permitted_until_s_) || !std::isfinite(wanted_m_s)) {
      return 0.0;
    }
    return std::clamp(wanted_m_s, -limit, limit);
  }

private:
  static constexpr std::uint32_t kMostLost = 10;
  static constexpr double kNever = -std::numeric_limits<double>::infinity();

  double full_;
  double slow_;
  std::optional<std::uint32_t> heartbeat_;
  double permitted_until_s_ = kNever;
  bool warned_ = true;  // until the alarms have been heard
};

}  // namespace shuttle_car
