#pragma once

#include <cstdint>

namespace tileflight::place {

/// Default memory limit for tiles: half of the machine's memory.
std::uintmax_t default_memory_bytes();

}  // namespace tileflight::place
