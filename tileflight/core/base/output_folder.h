#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
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

/// Lists all files (and links and other non-folders) below `folder`, relative to it, sorted. Links to folders are not
/// followed. Empty if the folder does not exist.
std::vector<std::string> list_files_recursive(const std::filesystem::path& folder);

/// Writes the marker of a finished folder; it lists all files in it. The same files give the same bytes. A run of
/// numbered files is stored as one line, to keep the marker small. Throws InputError.
void write_folder_marker(const std::filesystem::path& folder, const std::string& command);

/// Reads the marker of a folder. nullopt: there is none, or this program did not write it.
std::optional<FolderMarker> read_folder_marker(const std::filesystem::path& folder);

/// A folder that a command writes, and what may be replaced there.
struct OutputFolder {
  std::filesystem::path folder;
  std::string command;  ///< "render"; stored in the marker
  bool replace = false;
  std::vector<std::filesystem::path> inputs{};  ///< files and folders that the command reads; missing ones are ignored
};

/// Returns the absolute path of a folder with links and ".." resolved, without a trailing slash.
std::filesystem::path resolve_folder(const std::filesystem::path& folder);

/// Throws InputError if the folder may not be written: it exists and `replace` is false, it holds files not written by
/// this program, it contains an input, or it lies inside one. Restores a backup left by a process that was killed
/// between two renames.
void require_writable(const OutputFolder& output);

/// Runs `fill` on a sibling temporary folder and moves it into place when it returns; removes it when it throws. At any
/// moment the folder is entirely the old or entirely the new one. Throws as require_writable().
void write_folder(const OutputFolder& output, const std::function<void(const std::filesystem::path& temporary)>& fill);

/// Moves a folder that was built beside `output.folder` (on the same file system) into its place, with a marker in it.
/// If foreign files have appeared in the old folder meanwhile, it is moved aside instead of removed, and InputError is
/// thrown.
void install_folder(const std::filesystem::path& built, const OutputFolder& output);

/// Returns the first file below `folder` that this program did not write: one that the folder's marker does not list
/// or, without a marker, any. nullopt: there is none.
std::optional<std::string> find_foreign_file(const std::filesystem::path& folder);

/// Whether a command wrote this folder and it cannot be part of a tileset (a command's output can itself be a tileset).
bool is_result_folder(const std::filesystem::path& folder);

/// Whether a file name matches a pattern: '#' matches a digit, '*' any characters but '/'.
bool matches_pattern(std::string_view name, std::string_view pattern);

/// Removes a file, or a folder that holds only files written by this program. Throws InputError, naming the file, if it
/// holds any other.
void remove_output(const std::filesystem::path& path);

/// Checks, before work whose result is a single file, that the file may be written. Throws InputError if `file` is an
/// input, or a file of an input folder: outputs never overwrite inputs. A file in a command's output folder that the
/// command did not write is not an input. Makes the folder of `file` if it is missing.
void prepare_output_file(const std::filesystem::path& file, const std::vector<std::filesystem::path>& inputs);

}  // namespace tileflight::base
