#include "tileflight/core/base/temporary_path.h"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/core/base/input_error.h"

namespace tileflight::base {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kTemporary = ".tmp";
constexpr std::string_view kMovedAside = ".old";

std::string start_of_names(const fs::path& target) { return "." + target.filename().string() + "."; }

/// The process id in "PID-N"; 0 if the text has another form.
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

bool is_abandoned(const std::string& name, const std::string& start, std::string_view ending) {
  if (name.size() <= start.size() + ending.size() || !name.starts_with(start) || !name.ends_with(ending)) return false;
  const pid_t process =
      process_of(std::string_view(name).substr(start.size(), name.size() - start.size() - ending.size()));
  return process > 0 && !runs(process);
}

/// Folders that cannot be listed give an empty result.
std::vector<fs::path> abandoned_beside(const fs::path& target, std::string_view ending) {
  const std::string start = start_of_names(target);
  const fs::path folder = target.has_parent_path() ? target.parent_path() : fs::path(".");
  std::vector<fs::path> abandoned;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    if (is_abandoned(entry->path().filename().string(), start, ending)) abandoned.push_back(entry->path());
  }
  return abandoned;
}

/// Files that cannot be removed are left: they do no harm.
void remove_all(const std::vector<fs::path>& paths) {
  std::error_code ignored;
  for (const fs::path& path : paths) fs::remove_all(path, ignored);
}

fs::path new_name_beside(const fs::path& target, std::string_view ending) {
  for (int attempt = 0;; ++attempt) {
    const fs::path candidate = target.parent_path() / (start_of_names(target) + std::to_string(::getpid()) + "-" +
                                                       std::to_string(attempt) + std::string(ending));
    std::error_code error;
    if (!fs::exists(fs::symlink_status(candidate, error))) return candidate;
  }
}

}  // namespace

fs::path make_temporary_path(const fs::path& target) {
  remove_all(abandoned_beside(target, kTemporary));
  return new_name_beside(target, kTemporary);
}

bool is_abandoned_temporary(const fs::path& file_name) {
  const std::string name = file_name.string();
  if (!name.starts_with('.') || !name.ends_with(kTemporary)) return false;
  const std::size_t dot = name.rfind('.', name.size() - kTemporary.size() - 1);
  return dot != std::string::npos && dot > 0 && is_abandoned(name, name.substr(0, dot + 1), kTemporary);
}

fs::path make_backup_path(const fs::path& target) { return new_name_beside(target, kMovedAside); }

void restore_backup(const fs::path& target) {
  std::vector<fs::path> moved = abandoned_beside(target, kMovedAside);
  std::error_code error;
  if (!moved.empty() && !fs::exists(fs::symlink_status(target, error))) {
    fs::rename(moved.back(), target, error);
    if (!error) moved.pop_back();
  } else {
    remove_all(moved);
  }
}

void rename_or_throw(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::rename(from, to, error);
  if (error) throw InputError(to.string(), "cannot be written: " + error.message());
}

}  // namespace tileflight::base
