#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "tileflight/core/jobs/build_folder.h"

namespace tileflight::experiment {

/// A run's folder, locked exclusively by this process for the lifetime of the object; the kernel releases the lock when
/// the process ends, even in a crash.
///   DIR/.tileflight    marks it as a run folder
///   DIR/.lock          locked by the process that uses it, and contains its id
///   DIR/.file-hashes   FileHashCache
class RunFolder {
 public:
  /// Creates the folder or opens an earlier run's. Throws InputError if it is a file or holds something else, and if
  /// another process, which is named, uses it.
  explicit RunFolder(std::filesystem::path folder);

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path hash_cache_file() const { return path_ / ".file-hashes"; }

 private:
  std::filesystem::path path_;
  std::optional<jobs::FolderLock> lock_;
};

/// Throws InputError if `folder` exists and holds anything but an earlier run.
void check_run_folder(const std::filesystem::path& folder);

/// Removes a run's results below a part of its folder (a further odometry run, a variant), and folders that are then
/// empty. Other files are kept.
void remove_results(const std::filesystem::path& part);

}  // namespace tileflight::experiment
