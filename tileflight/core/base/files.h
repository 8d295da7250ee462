#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "tileflight/core/base/input_error.h"

namespace tileflight::base {

/// Makes a folder and its parents where they do not exist. Throws InputError.
inline void make_folder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (error) throw InputError(folder.string(), "cannot be made: " + error.message());
}

/// Reads a JSON file. Throws InputError (file) if it cannot be read or is not valid JSON.
nlohmann::json read_json(const std::filesystem::path& file);

/// Reads the whole file; throws InputError if it cannot be opened or read, or is larger than `max_bytes`.
std::string read_text(const std::filesystem::path& file, std::uintmax_t max_bytes = std::uintmax_t{1} << 32);
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
