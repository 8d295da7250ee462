#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

namespace tileflight::base {

/// Returns the default memory limit for tiles, bytes: half of the memory of this machine, or of its container (the
/// limit of this process's control group, Linux).
std::uintmax_t default_memory_bytes();

/// Returns the memory that a new program can take without displacing others, bytes: what the kernel calls available, at
/// most what the control group of this process allows (Linux). Returns the largest number if it is unknown.
std::uintmax_t available_memory_bytes();

/// Gives the allocator's free pages back to the system (glibc). Each thread has an arena of its own, and memory that
/// one step freed there does not serve the threads of the next: without this call, odometry after rendering (100 frames
/// of 2688 x 1512) took 1596 MB to use 769 MB.
void return_free_pages();

/// Memory that a control group allows (cgroup v2), bytes; the largest number if it sets no limit.
struct ControlGroupMemory {
  std::uintmax_t limit = 0;  ///< the least of it and the groups around it
  std::uintmax_t left = 0;   ///< the least amount that one of them has not used yet
};

/// Reads the memory limits of a control group. `top` is where the hierarchy is mounted (/sys/fs/cgroup), `line` a line
/// of /proc/self/cgroup ("0::/system.slice/x.service").
ControlGroupMemory control_group_memory(const std::filesystem::path& top, std::string_view line);

/// Returns the number behind `key` in a text such as /proc/meminfo ("MemAvailable:   123 kB"), bytes; nullopt if the
/// key is missing.
std::optional<std::uintmax_t> meminfo_bytes(std::string_view text, std::string_view key);

}  // namespace tileflight::base
