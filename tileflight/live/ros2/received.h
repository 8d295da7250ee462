#pragma once

#include <cstdint>
#include <functional>

#include "tileflight/live/ros2/raw_type.h"

namespace tileflight::ros2 {

/// Takes all messages that wait at a reader; `sender` names their writer (dds_instance_handle_t).
void take_all(std::int32_t reader, const std::function<void(const RawMessage& message, std::uint64_t sender)>& handle);

}  // namespace tileflight::ros2
