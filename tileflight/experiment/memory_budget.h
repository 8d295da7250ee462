#pragma once

#include <cstdint>

namespace tileflight::experiment {

/// What tiles may take where nobody says: half of the machine's memory.
std::uintmax_t default_memory_bytes();

}  // namespace tileflight::experiment
