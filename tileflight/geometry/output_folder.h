#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::geometry {

/// What the folders of a command hold that were written before there was a marker (folder_marker.h).
struct UnmarkedFolder {
  std::string key_file;  ///< must be there ("dataset.yaml"); empty: none
  std::string key_text;  ///< must stand in the key file, where others write files of that name, too
  /// All files that such a folder may hold, relative to it: '#' stands for a digit, '*' for anything but '/'. Empty:
  /// folders of the command are known by their marker alone.
  std::vector<std::string> files;
};

/// A folder that a command writes.
struct OutputFolder {
  std::filesystem::path folder;
  std::string command;  ///< "render": goes into the marker
  bool replace = false;
  std::vector<std::filesystem::path>
      inputs;  ///< files and folders that the command reads; what is not there is left out
  UnmarkedFolder unmarked;
};

/// The folder that a path names: absolute, through links and "..", without a slash at the end.
std::filesystem::path resolved_folder(const std::filesystem::path& folder);

/// Throws InputError where the folder may not be written: it is there and not to be replaced, or holds what this
/// program did not write, or an input, or is a part of one. Puts back what a process that was killed between two
/// renames has left beside it.
void require_writable(const OutputFolder& output);

/// Runs `fill` on a sibling temporary folder and puts it in the folder's place when it returns; removes it when it
/// throws. At every moment the folder is the old one or the new one, whole. Throws what require_writable() throws.
void write_folder(const OutputFolder& output, const std::function<void(const std::filesystem::path& temporary)>& fill);

/// Puts a folder that was built beside `output.folder` (on the same file system) in its place, with a marker in it.
/// What has got files of others meanwhile is not removed but moved aside, which is an InputError after all.
void put_in_place(const std::filesystem::path& built, const OutputFolder& output);

/// The first file below `folder` that this program did not write there: not in the folder's marker, and where it has
/// none, not of `unmarked`. nullopt: all are ours.
std::optional<std::string> foreign_file(const std::filesystem::path& folder, const UnmarkedFolder& unmarked = {});

/// Whether a command has written this folder, and it can be no part of a tileset (as a tileset can).
bool is_result_folder(const std::filesystem::path& folder);

/// Whether a file's name is as a pattern has it: '#' stands for a digit, '*' for any characters but '/'.
bool matches(std::string_view name, std::string_view pattern);

/// Removes a file, or a folder that holds nothing but what this program wrote there. Throws InputError for any other,
/// and names the file.
void remove_output(const std::filesystem::path& path);

/// Throws InputError where `file` is one of the inputs, or a file of an input folder: what a command writes never takes
/// the place of what it reads. A file beside those that a command wrote into its folder is none of them.
void require_no_input(const std::filesystem::path& file, const std::vector<std::filesystem::path>& inputs);

}  // namespace tileflight::geometry
