#pragma once

#include <filesystem>
#include <system_error>
#include <utility>

namespace tileflight::base {

/// An unused name beside `target`, for a file that is renamed to `target` when complete: ".NAME.PID-N.tmp". Also
/// removes files of such names left by processes of this machine that no longer run, because a killed run cannot clean
/// up after itself.
std::filesystem::path make_temporary_path(const std::filesystem::path& target);

/// Whether `file_name` is that of a temporary file whose process no longer runs.
bool is_abandoned_temporary(const std::filesystem::path& file_name);

/// Backup name beside `target` for the existing file or folder while it is being replaced: ".NAME.PID-N.old".
std::filesystem::path make_backup_path(const std::filesystem::path& target);

/// Recovers from a process that was killed while replacing `target`: puts the backup back if `target` is missing,
/// removes the backup if `target` is there.
void restore_backup(const std::filesystem::path& target);

/// Removes a temporary file or folder unless it was renamed away.
class RemovedOnExit {
 public:
  explicit RemovedOnExit(std::filesystem::path path) : path_(std::move(path)) {}
  ~RemovedOnExit() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  RemovedOnExit(const RemovedOnExit&) = delete;
  RemovedOnExit& operator=(const RemovedOnExit&) = delete;

 private:
  std::filesystem::path path_;
};

/// Throws InputError if that is not possible.
void rename_or_throw(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace tileflight::base
