#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

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

/// The share of a build folder's work that one process does.
enum class Share {
  kWhole,  ///< all of it: no other job may use the folder
  kPart,   ///< one part, while other processes do the other parts
};

/// A hidden folder beside an output DIR/NAME in which a job of one or more processes builds that output. If the job
/// dies, the next one continues from what is already finished:
///   DIR/.NAME.KIND/inputs.json    what the output is made from: another job continues only from the same
///                  members/NAME   locked while the process of this name lives
/// The kernel releases the locks of a process that ends, even killed; a file system without locks is used without them.
/// The machines of a job share the folder.
class BuildFolder {
 public:
  static std::filesystem::path path_beside(const std::filesystem::path& output, const std::string& kind);

  /// Prepares the folder for work from `inputs`. Keeps what is there from the same inputs and removes all else; with
  /// another job at work there, throws InputError instead. `folders`: created in it; if one is missing, nothing is
  /// kept. Returns why something was removed ("… because these inputs differ: settings"); empty: nothing was.
  static std::string prepare(const std::filesystem::path& folder, const nlohmann::json& inputs, Share share,
                             const std::vector<std::string>& folders);

  /// Reads inputs.json; null if there is none.
  static nlohmann::json read_inputs(const std::filesystem::path& folder);

  /// Enters a prepared folder under a name. A part waits while a process of an earlier job, which does the same part,
  /// still has that name. Throws InputError.
  BuildFolder(std::filesystem::path folder, const std::string& name, Share share);
  ~BuildFolder();
  BuildFolder(const BuildFolder&) = delete;
  BuildFolder& operator=(const BuildFolder&) = delete;

  const std::filesystem::path& path() const { return folder_; }
  /// Removes the folder once its work is elsewhere.
  void remove() const;

 private:
  std::filesystem::path folder_;
  int lock_ = -1;  ///< file descriptor; -1: no lock
};

}  // namespace tileflight::jobs
