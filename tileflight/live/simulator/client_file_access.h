#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace tileflight::simulator {

/// Restricts the files that clients may write to one folder, or forbids writing.
class ClientFileAccess {
 public:
  explicit ClientFileAccess(std::optional<std::filesystem::path> root);

  /// The path for a client's file name; relative names are below the folder. Creates its parent folders. Throws
  /// InputError if writing is forbidden, or the name is invalid or leads out of the folder (links are followed).
  std::filesystem::path resolve_writable(const std::string& name) const;
  const std::optional<std::filesystem::path>& root() const { return root_; }

 private:
  std::optional<std::filesystem::path> root_;  ///< canonical
};

}  // namespace tileflight::simulator
