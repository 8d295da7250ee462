#pragma once

#include <filesystem>
#include <string>

namespace tileflight::experiment {

/// The folder of a run, this process's alone as long as this lives: the kernel ends the lock with the process, however
/// that ends.
///   DIR/.tileflight    says that it is a run's
///   DIR/.lock          locked by the process that works in it, and names it
///   DIR/.file-hashes   FileHashes
class RunFolder {
 public:
  /// Makes it, or takes an earlier run's. Throws InputError where it is a file or holds something else, and where
  /// another process works in it, which is named.
  explicit RunFolder(std::filesystem::path folder);
  ~RunFolder();
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path file_hashes() const { return path_ / ".file-hashes"; }

 private:
  std::filesystem::path path_;
  int lock_ = -1;  ///< file descriptor; -1: the file system has no locks
};

/// Throws InputError when `folder` is there and holds something else than an earlier run.
void check_run_folder(const std::filesystem::path& folder);

/// Removes what runs have left below a part of a run folder (a further run of odometry, a variant), and folders that
/// are empty then. What they did not write stays where it is.
void remove_results(const std::filesystem::path& part);

}  // namespace tileflight::experiment
