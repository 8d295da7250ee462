#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tileflight::geometry {

/// Name of the file that says of a folder that this program wrote it, and which files it wrote there. Readers of our
/// folders do not heed it.
inline constexpr const char* kFolderMarker = ".tileflight";

/// What kFolderMarker holds.
struct FolderMarker {
  std::string command;             ///< "render"
  std::vector<std::string> files;  ///< all of the folder's, relative to it ("images/000000.jpg"), sorted; not its own
};

/// All files (and links and whatever else is no folder) below `folder`, relative to it, sorted. Links to folders are
/// not followed. Empty where there is no such folder.
std::vector<std::string> files_below(const std::filesystem::path& folder);

/// Writes the marker of a finished folder: all files that are in it are ours. The same files give the same bytes.
/// Numbered files in a row take one line, so that it stays small. Throws InputError.
void write_folder_marker(const std::filesystem::path& folder, const std::string& command);

/// nullopt: there is none, or it is none of ours.
std::optional<FolderMarker> read_folder_marker(const std::filesystem::path& folder);

}  // namespace tileflight::geometry
