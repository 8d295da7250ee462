#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

namespace tileflight::place {

/// Default memory limit for tiles: half of the machine's memory.
std::uintmax_t default_memory_bytes();

/// Memory that a new program can take without others having to give up theirs: what the kernel calls available, and at
/// most what the control group of this process allows (Linux). The largest number if that is not known.
std::uintmax_t available_memory_bytes();

/// The number behind `key` in a text such as /proc/meminfo ("MemAvailable:   123 kB"), bytes; nullopt if it is not
/// there.
std::optional<std::uintmax_t> meminfo_bytes(std::string_view text, std::string_view key);

}  // namespace tileflight::place
