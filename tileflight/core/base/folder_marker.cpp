// Format of .tileflight, a text file:
//   tileflight render
//   # comment: purpose of this file
//   camera.yaml
//   images/000000.jpg<tab>images/000341.jpg     a run of numbered files, first and last
#include "tileflight/core/base/folder_marker.h"

#include <algorithm>
#include <charconv>
#include <sstream>
#include <string_view>
#include <tuple>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::base {
namespace {

namespace fs = std::filesystem;

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

}  // namespace tileflight::base
