#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tileflight::base {

/// Name of the file that marks a folder as written by this program and lists the files it wrote there. Dataset and
/// result readers ignore it.
inline constexpr const char* kFolderMarker = ".tileflight";

/// Content of the kFolderMarker file.
struct FolderMarker {
  std::string command;             ///< "render"
  std::vector<std::string> files;  ///< all files but the marker, relative to the folder ("images/000000.jpg"), sorted
};

/// All files (and links and other non-folders) below `folder`, relative to it, sorted. Links to folders are not
/// followed. Empty if the folder does not exist.
std::vector<std::string> list_files_recursive(const std::filesystem::path& folder);

/// Writes the marker of a finished folder; it lists all files in it. The same files give the same bytes. A run of
/// numbered files is stored as one line, to keep the marker small. Throws InputError.
void write_folder_marker(const std::filesystem::path& folder, const std::string& command);

/// nullopt: there is no marker, or it was not written by this program.
std::optional<FolderMarker> read_folder_marker(const std::filesystem::path& folder);

}  // namespace tileflight::base
