// Definitions: https://github.com/ros2/common_interfaces (Humble).
#include "tileflight/live/ros2/command_messages.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/input_error.h"
#include "tileflight/data/messages/cdr.h"

namespace tileflight::ros2 {
namespace {

constexpr std::size_t kMaxFrameId = 1000;
constexpr double kUnitLength = 1e-3;

template <std::size_t N>
std::array<double, N> finite_numbers(messages::CdrReader& reader, const std::string& what) {
  std::array<double, N> numbers{};
  for (double& number : numbers) number = reader.number<double>();
  if (!std::ranges::all_of(numbers, [](double x) { return std::isfinite(x); }))
    throw InputError(what, "a message holds a number that is not finite");
  return numbers;
}

}  // namespace

Twist read_twist(std::string_view cdr, const std::string& what) {
  messages::CdrReader reader(cdr, what);
  const auto linear_m_s = finite_numbers<3>(reader, what);
  return {linear_m_s, finite_numbers<3>(reader, what)};
}

PoseStamped read_pose_stamped(std::string_view cdr, const std::string& what) {
  messages::CdrReader reader(cdr, what);
  PoseStamped pose;
  const auto seconds = reader.number<std::int32_t>();
  pose.time_ns = std::int64_t{seconds} * 1000000000 + reader.number<std::uint32_t>();
  pose.frame_id = reader.text(kMaxFrameId);
  pose.position_m = finite_numbers<3>(reader, what);
  pose.orientation_xyzw = finite_numbers<4>(reader, what);
  double squares = 0.0;
  for (const double x : pose.orientation_xyzw) squares += x * x;
  if (!(std::abs(std::sqrt(squares) - 1.0) <= kUnitLength))
    throw InputError(what, "the orientation of a pose is a quaternion whose length is not 1");
  return pose;
}

bool read_set_bool(std::string_view cdr, const std::string& what) {
  return messages::CdrReader(cdr, what).number<std::uint8_t>() != 0;
}

std::string service_response(bool is_success, std::string_view message) {
  return messages::CdrWriter()
      .number(std::uint8_t{is_success ? std::uint8_t{1} : std::uint8_t{0}})
      .text(message)
      .bytes();
}

}  // namespace tileflight::ros2
