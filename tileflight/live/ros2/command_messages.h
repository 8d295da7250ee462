#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace tileflight::ros2 {

// Readers of the messages that nodes send to the simulator. `what`, a topic or service, begins the messages of errors.

/// geometry_msgs/msg/Twist; axes x forward, y left, z up (REP 103).
struct Twist {
  std::array<double, 3> linear_m_s{}, angular_rad_s{};
};
/// Throws InputError for a message that is cut off or not finite.
Twist read_twist(std::string_view cdr, const std::string& what);

/// geometry_msgs/msg/PoseStamped.
struct PoseStamped {
  std::int64_t time_ns = 0;
  std::string frame_id;
  std::array<double, 3> position_m{};
  std::array<double, 4> orientation_xyzw{};  ///< of length 1
};
/// Throws InputError for a message that is cut off, not finite, or without a rotation (a quaternion's length must be 1
/// within a thousandth).
PoseStamped read_pose_stamped(std::string_view cdr, const std::string& what);

/// Reads the request of std_srvs/srv/SetBool. Throws InputError.
bool read_set_bool(std::string_view cdr, const std::string& what);
/// Writes the response of std_srvs/srv/SetBool or Trigger.
std::string service_response(bool is_success, std::string_view message);

}  // namespace tileflight::ros2
