#pragma once

#include <filesystem>

namespace tileflight::jobs {

/// A folder that one process uses at a time: its file kFile is locked exclusively for the lifetime of the object, and
/// holds the process's id. The kernel releases the lock when the process ends, even in a crash. A file system without
/// locks is used without one.
class FolderLock {
 public:
  static constexpr const char* kFile = ".lock";

  /// Throws InputError if another process, which is named, uses the folder, and if the folder cannot be written.
  explicit FolderLock(const std::filesystem::path& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int file_ = -1;  ///< file descriptor; -1: no lock
};

}  // namespace tileflight::jobs
