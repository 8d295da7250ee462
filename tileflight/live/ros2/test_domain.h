#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstdlib>

#include "tileflight/live/ros2/participant.h"

namespace tileflight::ros2 {

/// A domain that other tests, which run at the same time, hardly use; on this machine alone.
inline std::uint32_t test_domain() {
  ::unsetenv("CYCLONEDDS_URI");
  return 100 + static_cast<std::uint32_t>(::getpid()) % (kMaxDomain - 100);
}

}  // namespace tileflight::ros2
