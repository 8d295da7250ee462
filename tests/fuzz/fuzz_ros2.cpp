#include <cmath>
#include <cstdlib>
#include <string>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/ros2/command_messages.h"
#include "tileflight/live/ros2/service.h"

namespace {

using namespace tileflight;

void read_commands(std::string_view cdr, char kind) {
  switch (kind) {
    case 't': {
      for (const double x : ros2::read_twist(cdr, "fuzz").linear_m_s) {
        if (!std::isfinite(x)) std::abort();
      }
      return;
    }
    case 'p': {
      const ros2::PoseStamped pose = ros2::read_pose_stamped(cdr, "fuzz");
      double squares = 0.0;
      for (const double x : pose.orientation_xyzw) squares += x * x;
      if (!(squares > 0.9 && squares < 1.1) || pose.frame_id.size() > 1000) std::abort();
      return;
    }
    default: {
      const ros2::ServiceMessage request = ros2::read_service_message(cdr, "fuzz");
      if (ros2::write_service_message(request).size() != cdr.size()) std::abort();
      ros2::read_set_bool(request.body, "fuzz");
    }
  }
}

}  // namespace

/// A message's kind, then its CDR, as nodes send it: a Twist, a PoseStamped, or a service's request.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  try {
    read_commands({reinterpret_cast<const char*>(data) + 1, size - 1}, static_cast<char>(data[0]));
  } catch (const InputError&) {
    // refused
  }
  return 0;
}
