#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace tileflight::simulator {

/// Where clients may have files written: below one folder, or nowhere.
class FileAccess {
 public:
  explicit FileAccess(std::optional<std::filesystem::path> root);

  /// The path that a client's name stands for, relative ones below the folder; its parent folders are made. Throws
  /// InputError: no folder is given, the name leads out of it (links are followed) or is none.
  std::filesystem::path writable(const std::string& name) const;
  const std::optional<std::filesystem::path>& root() const { return root_; }

 private:
  std::optional<std::filesystem::path> root_;  ///< canonical
};

}  // namespace tileflight::simulator
