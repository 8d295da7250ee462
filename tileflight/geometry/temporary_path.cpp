#include "tileflight/geometry/temporary_path.h"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::geometry {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kEnding = ".tmp";

std::string start_of_names(const fs::path& target) { return "." + target.filename().string() + "."; }

/// The process in "PID-N", or 0 where the text is nothing of the kind.
pid_t process_of(std::string_view text) {
  const std::size_t dash = text.find('-');
  if (dash == std::string_view::npos) return 0;
  const std::string_view attempt = text.substr(dash + 1);
  const bool digits =
      !attempt.empty() && std::all_of(attempt.begin(), attempt.end(), [](char c) { return c >= '0' && c <= '9'; });
  pid_t process = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + dash, process);
  return digits && fault == std::errc() && end == text.data() + dash && process > 0 ? process : 0;
}

bool runs(pid_t process) { return ::kill(process, 0) == 0 || errno != ESRCH; }

bool is_abandoned(const std::string& name, const std::string& start) {
  if (name.size() <= start.size() + kEnding.size() || !name.starts_with(start) || !name.ends_with(kEnding))
    return false;
  const std::string_view middle =
      std::string_view(name).substr(start.size(), name.size() - start.size() - kEnding.size());
  const pid_t process = process_of(middle);
  return process > 0 && !runs(process);
}

/// What cannot be listed or removed stays: it is in nobody's way.
void remove_abandoned(const fs::path& target) {
  const std::string start = start_of_names(target);
  const fs::path folder = target.has_parent_path() ? target.parent_path() : fs::path(".");
  std::vector<fs::path> abandoned;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    if (is_abandoned(entry->path().filename().string(), start)) abandoned.push_back(entry->path());
  }
  for (const fs::path& path : abandoned) fs::remove_all(path, error);
}

}  // namespace

fs::path temporary_beside(const fs::path& target) {
  remove_abandoned(target);
  for (int attempt = 0;; ++attempt) {
    const fs::path candidate = target.parent_path() / (start_of_names(target) + std::to_string(::getpid()) + "-" +
                                                       std::to_string(attempt) + std::string(kEnding));
    std::error_code error;
    if (!fs::exists(fs::symlink_status(candidate, error))) return candidate;
  }
}

}  // namespace tileflight::geometry
