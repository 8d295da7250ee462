#include "tileflight/core/base/output_folder.h"

#include <fcntl.h>
#include <stdio.h>

#include <algorithm>
#include <charconv>
#include <sstream>
#include <string_view>
#include <system_error>
#include <tuple>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"

// Format of .tileflight, a text file:
//   tileflight render
//   # comment: purpose of this file
//   camera.yaml
//   images/000000.jpg<tab>images/000341.jpg     a run of numbered files, first and last

namespace tileflight::base {
namespace fs = std::filesystem;

namespace {

constexpr std::string_view kFirstWord = "tileflight ";
constexpr std::string_view kAbout =
    "# This folder was written by this command. --force replaces it as long as it holds no other files than these:\n";
constexpr std::uintmax_t kMaxBytes = 256 << 20;
constexpr std::size_t kMaxDigits = 9;
constexpr std::size_t kMaxFiles = 50'000'000;  // a run could declare more names than fit into memory

/// A name that contains a number: the text before its last digits, their value and count, the text after them.
struct NumberedName {
  std::string before, after;
  std::size_t number = 0, digits = 0;

  bool is_next_of(const NumberedName& other) const {
    return digits > 0 && other.digits == digits && number == other.number + 1 &&
           std::tie(before, after) == std::tie(other.before, other.after);
  }
};

NumberedName parse_name(const std::string& name) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  const auto last = std::find_if(name.rbegin(), name.rend(), is_digit);
  const auto end = static_cast<std::size_t>(name.rend() - last);
  const auto begin = static_cast<std::size_t>(name.rend() - std::find_if_not(last, name.rend(), is_digit));
  NumberedName parts{name.substr(0, begin), name.substr(end), 0, end - begin};
  if (parts.digits == 0 || parts.digits > kMaxDigits) return {name, "", 0, 0};
  std::from_chars(name.data() + begin, name.data() + end, parts.number);
  return parts;
}

std::string name_of(const NumberedName& parts, std::size_t number) {
  std::string digits = std::to_string(number);
  if (digits.size() < parts.digits) digits.insert(0, parts.digits - digits.size(), '0');
  return parts.before + digits + parts.after;
}

/// Escapes control characters, '%' and '#' as "%0A": a name then fits on one line, contains no tab and is no comment.
std::string escaped(const std::string& name) {
  constexpr std::string_view kHex = "0123456789ABCDEF";
  std::string text;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x20 && c != '%' && c != '#') {
      text += c;
    } else {
      text += {'%', kHex[byte >> 4U], kHex[byte & 15U]};
    }
  }
  return text;
}

std::string unescaped(std::string_view text) {
  std::string name;
  for (std::size_t i = 0; i < text.size(); ++i) {
    int byte = 0;
    const bool is_code = text[i] == '%' && i + 2 < text.size() &&
                         std::from_chars(text.data() + i + 1, text.data() + i + 3, byte, 16).ptr == text.data() + i + 3;
    name += is_code ? static_cast<char>(byte) : text[i];
    if (is_code) i += 2;
  }
  return name;
}

/// False: not a valid line.
bool add_line(std::string_view line, std::vector<std::string>& files) {
  const std::size_t tab = line.find('\t');
  const std::string first = unescaped(line.substr(0, tab));
  files.push_back(first);
  if (tab == std::string_view::npos) return true;
  const NumberedName from = parse_name(first), to = parse_name(unescaped(line.substr(tab + 1)));
  if (to.number > from.number + kMaxFiles) return false;
  for (std::size_t n = from.number + 1; n <= to.number; ++n) files.push_back(name_of(from, n));
  return files.size() <= kMaxFiles;
}

constexpr const char* kElsewhere = "; choose another folder";

/// Whether `path` is `folder` or lies below it, after resolving links; both must exist.
bool is_within(const fs::path& path, const fs::path& folder) {
  std::error_code error;
  const fs::path whole = fs::canonical(path, error);
  if (error) return false;
  for (fs::path part = whole;; part = part.parent_path()) {
    if (fs::equivalent(part, folder, error)) return true;
    if (!part.has_relative_path()) return false;
  }
}

bool names_a_tileset(const FolderMarker& marker) {
  return std::any_of(marker.files.begin(), marker.files.end(),
                     [](const std::string& file) { return fs::path(file).filename() == "tileset.json"; });
}

/// Reason why an existing folder must not be replaced; empty: it may.
std::string objection(const fs::path& target, const OutputFolder& output) {
  for (const fs::path& input : output.inputs) {
    if (input.empty() || !fs::exists(input)) continue;
    if (is_within(input, target)) return "holds " + input.string() + ", an input of this command" + kElsewhere;
    if (fs::is_directory(input) && is_within(target, input) && !is_result_folder(target))
      return "is part of " + input.string() + ", an input of this command" + kElsewhere;
  }
  const std::optional<std::string> foreign = find_foreign_file(target);
  if (!foreign) return "";
  const bool is_marked = read_folder_marker(target).has_value();
  return "holds " + *foreign + ", which " + (is_marked ? "tileflight did not write" : "may not be tileflight's") +
         "; --force replaces only what tileflight wrote: move the file away or choose another folder";
}

/// New name for a replaced folder that turns out to hold foreign files: "NAME.before", "NAME.before-2", …
fs::path aside_of(const fs::path& target) {
  const std::string name = target.string() + ".before";
  for (int attempt = 1;; ++attempt) {
    const fs::path candidate = attempt == 1 ? name : name + "-" + std::to_string(attempt);
    if (!fs::exists(fs::symlink_status(candidate))) return candidate;
  }
}

/// Swaps the folders `built` and `target`.
void exchange(const fs::path& built, const fs::path& target) {
  // In one atomic step, so that `target` always exists.
  if (::renameat2(AT_FDCWD, built.c_str(), AT_FDCWD, target.c_str(), RENAME_EXCHANGE) == 0) return;
  // For file systems without exchange (NFS): meanwhile the old folder has a name that restore_backup() recognises.
  const fs::path old = make_backup_path(target);
  rename_or_throw(target, old);
  std::error_code error;
  fs::rename(built, target, error);
  if (error) {
    std::error_code ignored;
    fs::rename(old, target, ignored);
    throw InputError(target.string(), "cannot be written: " + error.message());
  }
  rename_or_throw(old, built);
}

void make_folder_of(const fs::path& file) {
  std::error_code error;
  if (file.has_parent_path()) fs::create_directories(file.parent_path(), error);
  if (error) throw InputError(file.parent_path().string(), "cannot be made: " + error.message());
}

}  // namespace

std::vector<std::string> list_files_recursive(const fs::path& folder) {
  std::vector<std::string> files;
  std::error_code error;
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    if (fs::is_directory(entry->symlink_status(error))) continue;
    files.push_back(entry->path().lexically_relative(folder).generic_string());
  }
  if (error && fs::exists(folder)) throw InputError(folder.string(), "cannot be listed: " + error.message());
  std::sort(files.begin(), files.end());
  return files;
}

void write_folder_marker(const fs::path& folder, const std::string& command) {
  std::string text = std::string(kFirstWord) + command + "\n" + std::string(kAbout);
  std::vector<std::string> files = list_files_recursive(folder);
  std::erase(files, kFolderMarker);
  for (std::size_t i = 0; i < files.size(); ++i) {
    text += escaped(files[i]);
    NumberedName last = parse_name(files[i]);
    std::size_t row = i;
    for (; row + 1 < files.size(); ++row) {
      NumberedName next = parse_name(files[row + 1]);
      if (!next.is_next_of(last)) break;
      last = std::move(next);
    }
    if (row > i) text += "\t" + escaped(files[row]);
    text += "\n";
    i = row;
  }
  write_file(folder / kFolderMarker, text);
}

std::optional<FolderMarker> read_folder_marker(const fs::path& folder) {
  const fs::path file = folder / kFolderMarker;
  if (!fs::is_regular_file(file)) return std::nullopt;
  std::istringstream lines(read_text(file, kMaxBytes));
  FolderMarker marker;
  std::string line;
  if (!std::getline(lines, line) || !line.starts_with(kFirstWord)) return std::nullopt;
  marker.command = line.substr(kFirstWord.size());
  while (std::getline(lines, line)) {
    if (!line.empty() && line[0] != '#' && !add_line(line, marker.files)) return std::nullopt;
  }
  std::sort(marker.files.begin(), marker.files.end());
  return marker;
}

fs::path resolve_folder(const fs::path& folder) {
  // "out/" and "out" name the same folder; an absolute path has a parent for the temporary folder.
  const fs::path whole = fs::weakly_canonical(fs::absolute(folder));
  return whole.has_filename() ? whole : whole.parent_path();
}

bool is_result_folder(const fs::path& folder) {
  const std::optional<FolderMarker> marker = read_folder_marker(folder);
  return marker && !names_a_tileset(*marker);
}

bool matches_pattern(std::string_view name, std::string_view pattern) {
  if (pattern.empty()) return name.empty();
  if (pattern[0] == '*') {
    for (std::size_t taken = 0;; ++taken) {
      if (matches_pattern(name.substr(taken), pattern.substr(1))) return true;
      if (taken == name.size() || name[taken] == '/') return false;
    }
  }
  if (name.empty()) return false;
  const bool fits = pattern[0] == '#' ? name[0] >= '0' && name[0] <= '9' : name[0] == pattern[0];
  return fits && matches_pattern(name.substr(1), pattern.substr(1));
}

std::optional<std::string> find_foreign_file(const fs::path& folder) {
  const std::optional<FolderMarker> marker = read_folder_marker(folder);
  const auto is_ours = [&](const std::string& file) {
    return marker && (file == kFolderMarker || std::binary_search(marker->files.begin(), marker->files.end(), file) ||
                      is_abandoned_temporary(fs::path(file).filename()));
  };
  for (const std::string& file : list_files_recursive(folder)) {
    if (!is_ours(file)) return file;
  }
  return std::nullopt;
}

void require_writable(const OutputFolder& output) {
  const fs::path target = resolve_folder(output.folder);
  restore_backup(target);
  if (!fs::exists(target)) return;
  const std::string name = output.folder.string();
  if (!fs::is_directory(target))
    throw InputError(name, "is not a folder, and --force replaces only folders; choose another name");
  const std::string why = objection(target, output);
  if (!why.empty()) throw InputError(name, (output.replace ? "" : "exists already and ") + why);
  if (!output.replace) throw InputError(name, "exists already; --force replaces it");
}

void write_folder(const OutputFolder& output, const std::function<void(const fs::path& temporary)>& fill) {
  require_writable(output);
  const fs::path target = resolve_folder(output.folder);
  std::error_code error;
  fs::create_directories(target.parent_path(), error);
  const fs::path temporary = make_temporary_path(target);
  if (!fs::create_directory(temporary, error)) {
    throw InputError(output.folder.string(), "cannot be created: " + error.message());
  }
  const RemovedOnExit remove_temporary(temporary);
  fill(temporary);
  install_folder(temporary, output);
}

void write_folder(const fs::path& folder, bool replace, const std::function<void(const fs::path& temporary)>& fill) {
  write_folder(OutputFolder{.folder = folder, .command = "tileflight", .replace = replace}, fill);
}

void install_folder(const fs::path& built, const OutputFolder& output) {
  const fs::path target = resolve_folder(output.folder);
  write_folder_marker(built, output.command);
  if (!fs::exists(target)) return rename_or_throw(built, target);
  const std::string why = output.replace ? objection(target, output) : "was created while the command ran";
  if (!why.empty()) {
    const fs::path aside = aside_of(target);
    rename_or_throw(target, aside);
    rename_or_throw(built, target);
    throw InputError(output.folder.string(), "was written, but the folder of that name " + why +
                                                 "; that folder was renamed to " + aside.string());
  }
  exchange(built, target);
  std::error_code ignored;
  fs::remove_all(built, ignored);
}

void remove_output(const fs::path& path) {
  std::error_code error;
  if (fs::is_directory(fs::symlink_status(path, error))) {
    if (const auto foreign = find_foreign_file(path))
      throw InputError(path.string(), "holds " + *foreign + ", which tileflight did not write; move it away");
  }
  fs::remove_all(path, error);
  if (error) throw InputError(path.string(), "cannot be removed: " + error.message());
}

void prepare_output_file(const fs::path& file, const std::vector<fs::path>& inputs) {
  if (!fs::exists(file)) return make_folder_of(file);
  for (const fs::path& input : inputs) {
    if (input.empty() || !fs::exists(input)) continue;
    std::error_code error;
    if (fs::equivalent(file, input, error))
      throw InputError(file.string(), "is also an input of this command; choose another name");
    if (!fs::is_directory(input) || !is_within(file, input)) continue;
    const std::optional<FolderMarker> marker = read_folder_marker(input);
    const std::string name = fs::canonical(file).lexically_relative(fs::canonical(input)).generic_string();
    if (!marker || std::binary_search(marker->files.begin(), marker->files.end(), name))
      throw InputError(file.string(), "lies in " + input.string() + ", an input of this command; choose another name");
  }
}

}  // namespace tileflight::base
