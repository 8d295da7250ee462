#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

namespace tileflight::place {

/// Default memory limit for tiles: half of the machine's memory, or of what the control group of this process allows
/// (Linux; a container's limit).
std::uintmax_t default_memory_bytes();

/// Memory that a new program can take without displacing others: what the kernel calls available, and at
/// most what the control group of this process allows (Linux). The largest number if that is not known.
std::uintmax_t available_memory_bytes();

/// Memory that a control group allows (cgroup v2), bytes; the largest number if it sets no limit.
struct ControlGroupMemory {
  std::uintmax_t limit = 0;  ///< the least of it and the groups around it
  std::uintmax_t left = 0;   ///< likewise, of what they have not used yet
};

/// `top`: where the hierarchy is mounted, /sys/fs/cgroup. `line`: of /proc/self/cgroup, "0::/system.slice/x.service".
ControlGroupMemory control_group_memory(const std::filesystem::path& top, std::string_view line);

/// The number behind `key` in a text such as /proc/meminfo ("MemAvailable:   123 kB"), bytes; nullopt if it is not
/// there.
std::optional<std::uintmax_t> meminfo_bytes(std::string_view text, std::string_view key);

}  // namespace tileflight::place
