#include <cstddef>
#include <cstdint>
#include <span>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/zip_archive.h"

/// A .3tz of any bytes: its directory and index read, and some of its files.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tileflight;
  const auto bytes = std::as_bytes(std::span(data, size));
  const fetch::ZipLimits limits{.max_entries = 1000, .max_directory_bytes = 1 << 20, .max_file_bytes = 1 << 20};
  const auto read_at = [&](std::uint64_t offset, std::size_t length) {
    const auto part = bytes.subspan(static_cast<std::size_t>(offset), length);
    return std::vector<std::byte>(part.begin(), part.end());
  };
  try {
    const fetch::ZipArchive archive(read_at, size, "input", limits);
    for (const char* path : {"tileset.json", "a", "sub/a.b3dm"}) {
      if (archive.size(path)) archive.read(path);
    }
  } catch (const InputError&) {
    // one clear line is what broken input is worth
  }
  return 0;
}
