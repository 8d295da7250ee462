#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>

#include "tileflight/core/base/files.h"

namespace tileflight::tests {

/// Sets a, b, c, d of the matrix by which the images of an MP4's first track are shown (ISO/IEC 14496-12, 8.3.2): a
/// point x, y becomes a x + c y, b x + d y. {0, 1, -1, 0} turns by a quarter clockwise, {2, 0, 0, 1} makes pixels twice
/// as wide as high.
inline void set_track_matrix(const std::filesystem::path& file, const std::array<std::int32_t, 4>& abcd) {
  std::string bytes = base::read_raw(file);
  const std::size_t matrix = bytes.find("tkhd") + 4 + 40;
  const auto put = [&](std::size_t at, std::int32_t value) {
    for (std::size_t i = 0; i < 4; ++i)
      bytes[matrix + at + i] = static_cast<char>(static_cast<std::uint32_t>(value) >> (24 - 8 * i));
  };
  put(0, abcd[0] * 65536);
  put(4, abcd[1] * 65536);
  put(12, abcd[2] * 65536);
  put(16, abcd[3] * 65536);
  std::filesystem::remove(file);
  base::write_file(file, bytes);
}

}  // namespace tileflight::tests
