#include "tileflight/core/base/memory_budget.h"

#include <unistd.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>

namespace tileflight::base {
namespace {

constexpr std::uintmax_t kUnlimited = std::numeric_limits<std::uintmax_t>::max();

std::optional<std::string> read_line(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::string line;
  return std::getline(in, line) ? std::optional(line) : std::nullopt;
}

std::optional<std::uintmax_t> read_number(const std::filesystem::path& file) {
  const std::optional<std::string> line = read_line(file);
  std::uintmax_t number = 0;
  if (!line || std::from_chars(line->data(), line->data() + line->size(), number).ec != std::errc())
    return std::nullopt;
  return number;
}

ControlGroupMemory own_control_group() {
  return control_group_memory("/sys/fs/cgroup", read_line("/proc/self/cgroup").value_or(""));
}

}  // namespace

void return_free_pages() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

ControlGroupMemory control_group_memory(const std::filesystem::path& top, std::string_view line) {
  ControlGroupMemory memory{kUnlimited, kUnlimited};
  constexpr std::string_view kVersion2 = "0::/";
  if (!line.starts_with(kVersion2)) return memory;
  std::filesystem::path group = top / line.substr(kVersion2.size());
  for (; group.native().starts_with(top.native()); group = group.parent_path()) {
    const auto limit = read_number(group / "memory.max"), used = read_number(group / "memory.current");
    if (!limit) continue;
    memory.limit = std::min(memory.limit, *limit);
    memory.left = std::min(memory.left, *limit - std::min(*limit, used.value_or(0)));
  }
  return memory;
}

std::uintmax_t default_memory_bytes() {
  const long pages = sysconf(_SC_PHYS_PAGES), page_bytes = sysconf(_SC_PAGESIZE);
  std::uintmax_t machine = kUnlimited;
  if (pages > 0 && page_bytes > 0)
    machine = static_cast<std::uintmax_t>(pages) * static_cast<std::uintmax_t>(page_bytes);
  return std::min(machine, own_control_group().limit) / 2;
}

std::optional<std::uintmax_t> meminfo_bytes(std::string_view text, std::string_view key) {
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    std::string_view line = text.substr(begin, end - begin);
    begin = end + 1;
    if (!line.starts_with(key) || line.substr(key.size(), 1) != ":") continue;
    line.remove_prefix(std::min(line.find_first_of("0123456789"), line.size()));
    std::uintmax_t kilobytes = 0;
    const auto [rest, fault] = std::from_chars(line.data(), line.data() + line.size(), kilobytes);
    const bool is_number = fault == std::errc() && kilobytes < kUnlimited / 1024;
    return is_number ? std::optional(kilobytes * 1024) : std::nullopt;
  }
  return std::nullopt;
}

std::uintmax_t available_memory_bytes() {
  std::ifstream in("/proc/meminfo");
  const std::string text((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
  return std::min(meminfo_bytes(text, "MemAvailable").value_or(kUnlimited), own_control_group().left);
}

}  // namespace tileflight::base
