#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace tileflight::experiment {

/// SHA-256 of files, and of folders by their files' names and contents. A file with unchanged size, times and inode is
/// not read again; a touched one is, with the same hash.
class FileHashCache {
 public:
  /// `memory`: file that keeps hashes between runs of the program; empty: none. Unreadable entries are ignored.
  explicit FileHashCache(std::filesystem::path memory = {});

  /// Hash of a file, or of all files below a folder, following links. Ignored below it: names that begin with a dot,
  /// `left_out`, and folders written by a command, except tilesets. Throws InputError if the path does not exist.
  std::string hash(const std::filesystem::path& file_or_folder,
                   const std::vector<std::filesystem::path>& left_out = {}) const;

  /// Hash of a YAML file's content (core/base/document_value.h), or of another file's bytes. Throws InputError.
  static std::string hash_yaml_content(const std::filesystem::path& file);

  /// Saves the hashes for the next run of the program. Write errors are ignored: the hashes are then computed again.
  void save() const;

 private:
  /// Metadata that identify an unchanged file. Any change updates ctime, even if a program resets mtime.
  struct FileStamp {
    std::uintmax_t bytes = 0;
    std::uint64_t inode = 0;
    std::int64_t modified_ns = 0, changed_ns = 0;
    bool operator==(const FileStamp&) const = default;
  };
  struct Entry {
    FileStamp stamp;
    std::string sha256;
    bool operator==(const Entry&) const = default;
  };

  static FileStamp read_stamp(const std::filesystem::path& file);
  std::string hash_file(const std::filesystem::path& file) const;
  void read_cache();

  std::filesystem::path cache_file_;
  mutable std::mutex mutex_;                      // guards what follows
  mutable std::map<std::string, Entry> entries_;  ///< by absolute path
  mutable bool is_changed_ = false;
};

}  // namespace tileflight::experiment
