#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace tileflight::tiles {

/// The containers of 3D Tiles 1.0 (b3dm, i3dm, pnts, cmpt) and GLB begin alike: magic, version, length of the whole.

std::string_view as_text(std::span<const std::byte> bytes);

/// Little-endian. The caller has checked that it is there.
std::uint32_t uint32_at(std::span<const std::byte> bytes, std::size_t offset);

/// The content without what follows its own byteLength. Throws InputError when it is cut short.
std::span<const std::byte> whole_of(std::span<const std::byte> bytes, std::size_t header_bytes,
                                    const std::string& name);

/// Throws InputError when the version is another one.
void require_version(std::span<const std::byte> bytes, std::uint32_t wanted, const std::string& kind,
                     const std::string& name);

/// What stands between the header and the body.
struct TileTables {
  std::span<const std::byte> feature_json, feature_binary, batch_json, batch_binary;
  std::span<const std::byte> body;
};

/// How long each of them is, and where they begin.
struct TileTableLengths {
  std::size_t header = 28;
  std::size_t feature_json = 0, feature_binary = 0, batch_json = 0, batch_binary = 0;
};

/// As the header says, from byte 12 on.
TileTableLengths table_lengths(std::span<const std::byte> tile, std::size_t header_bytes);

/// Throws InputError when they reach beyond the end.
TileTables split_tables(std::span<const std::byte> tile, const TileTableLengths& lengths, const std::string& name);

}  // namespace tileflight::tiles
