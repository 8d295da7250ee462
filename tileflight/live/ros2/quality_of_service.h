#pragma once

#include <cstdint>

namespace tileflight::ros2 {

/// The parts of DDS's quality of service that ROS 2's nodes choose and compare.
struct QualityOfService {
  /// A reliable writer serves readers that ask for reliability and those that do not; a best-effort writer only the
  /// latter. A best-effort reader takes from both.
  bool is_reliable = true;
  bool is_latched = false;   ///< transient local: later subscribers get the last message
  std::uint32_t depth = 10;  ///< "keep last": how many messages wait for a reader, at most
};

}  // namespace tileflight::ros2
