#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "tileflight/core/base/input_error.h"

namespace tileflight::base {

/// An unused name beside `target`, for a file that is renamed to `target` when complete: ".NAME.PID-N.tmp". Also
/// removes files of such names left by processes of this machine that no longer run, because a killed run cannot clean
/// up after itself.
std::filesystem::path make_temporary_path(const std::filesystem::path& target);

/// Whether `file_name` is that of a temporary file whose process no longer runs.
bool is_abandoned_temporary(const std::filesystem::path& file_name);

/// Backup name beside `target` for the existing file or folder while it is being replaced: ".NAME.PID-N.old".
std::filesystem::path make_backup_path(const std::filesystem::path& target);

/// Recovers from a process that was killed while replacing `target`: puts the backup back if `target` is missing,
/// removes the backup if `target` is there.
void restore_backup(const std::filesystem::path& target);

/// Removes a temporary file or folder unless it was renamed away.
class RemovedOnExit {
 public:
  explicit RemovedOnExit(std::filesystem::path path) : path_(std::move(path)) {}
  ~RemovedOnExit() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  RemovedOnExit(const RemovedOnExit&) = delete;
  RemovedOnExit& operator=(const RemovedOnExit&) = delete;

 private:
  std::filesystem::path path_;
};

/// Renames a file or folder. Throws InputError if that is not possible.
void rename_or_throw(const std::filesystem::path& from, const std::filesystem::path& to);

/// Makes a folder and its parents where they do not exist. Throws InputError.
inline void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw InputError(folder.string(), "cannot be made: " + error.message());
}

/// Reads a JSON file. Throws InputError (file) if it cannot be read or is not valid JSON.
nlohmann::json read_json(const std::filesystem::path& file);

/// Reads the whole file as text in UTF-8 or ASCII, without the byte order mark that editors and spreadsheets put in
/// front. Throws InputError if it cannot be opened or read, is larger than `max_bytes` or is UTF-16.
std::string read_text(const std::filesystem::path& file, std::uintmax_t max_bytes = std::uintmax_t{1} << 32);
/// Reads the whole file as it is; throws InputError if it cannot be opened or read, or is larger than `max_bytes`.
std::string read_raw(const std::filesystem::path& file, std::uintmax_t max_bytes = std::uintmax_t{1} << 32);
std::vector<std::byte> read_bytes(const std::filesystem::path& file,
                                  std::uintmax_t max_bytes = std::uintmax_t{1} << 32);

/// Writes the file atomically: writes a temporary sibling, flushes and checks it, then renames it. Throws InputError
/// ("no space left", "permission denied", …).
void write_file(const std::filesystem::path& file, std::string_view bytes);

/// write_file() for content too large to hold in memory: `next` returns the parts in order, then an empty one at the
/// end.
void write_file_in_parts(const std::filesystem::path& file, const std::function<std::string_view()>& next);

/// Runs `fill` on a sibling temporary folder and renames it to `folder` when it returns; removes it when it
/// throws. An existing `folder` is an InputError unless `replace`.
void write_folder(const std::filesystem::path& folder, bool replace,
                  const std::function<void(const std::filesystem::path& temporary)>& fill);

/// SHA-256 of bytes or of a file's content, lower-case hexadecimal (FIPS 180-4).
std::string sha256_hex(std::string_view bytes);
std::string sha256_hex_of_file(const std::filesystem::path& file);

}  // namespace tileflight::base
