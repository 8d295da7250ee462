#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

namespace tileflight::base {

/// Default memory limit for tiles: half of the machine's memory, or of what the control group of this process allows
/// (Linux; a container's limit).
std::uintmax_t default_memory_bytes();

/// Memory that a new program can take without displacing others: what the kernel calls available, and at
/// most what the control group of this process allows (Linux). The largest number if that is not known.
std::uintmax_t available_memory_bytes();

/// Returns free pages between those in use to the system (glibc). What frames, tiles and keyframes leave in the arenas
/// of several threads does not serve the next step as it lies: in a run of 100 frames of 2688 x 1512, odometry began
/// with 772 MB free of 773 in the arenas, and came to take 1596 MB for 769 in use.
void return_free_pages();

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

}  // namespace tileflight::base
