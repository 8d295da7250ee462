#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <vector>

namespace tileflight::experiment {

/// SHA-256 of files, and of folders by their files' names and contents. A file that has the size, times and inode that
/// it had when it was last read is not read again; one that was touched is, and its hash is the same.
class FileHashes {
 public:
  /// `memory`: where hashes are kept between runs of the program; empty: nowhere. What cannot be read there is as good
  /// as nothing.
  explicit FileHashes(std::filesystem::path memory = {});

  /// Of a file, or of all files below a folder, through links. Left out below it: names that begin with a dot,
  /// `left_out`, and folders that a command has written there, tilesets excepted. Throws InputError where there is
  /// nothing.
  std::string of(const std::filesystem::path& file_or_folder,
                 const std::vector<std::filesystem::path>& left_out = {}) const;

  /// Of what a YAML file says (geometry/yaml_meaning.h), or of a file of another format. Throws InputError.
  static std::string of_meaning(const std::filesystem::path& file);

  /// Leaves what is known now for the next run of the program. What cannot be written is worked out again.
  void save() const;

 private:
  /// What tells that a file is as it was. A change sets ctime, whatever a program then does to mtime.
  struct Stamp {
    std::uintmax_t bytes = 0;
    std::uint64_t inode = 0;
    std::int64_t modified_ns = 0, changed_ns = 0;
    bool operator==(const Stamp&) const = default;
  };
  struct Known {
    Stamp stamp;
    std::string sha256;
    bool operator==(const Known&) const = default;
  };

  static Stamp stamp_of(const std::filesystem::path& file);
  std::string of_file(const std::filesystem::path& file) const;
  void read();

  std::filesystem::path memory_;
  mutable std::mutex mutex_;                    // guards what follows
  mutable std::map<std::string, Known> known_;  ///< by absolute path
  mutable bool is_changed_ = false;
};

}  // namespace tileflight::experiment
