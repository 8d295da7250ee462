#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace tileflight::tile_content {

// Common header of 3D Tiles 1.0 containers (b3dm, i3dm, pnts, cmpt) and GLB: magic, version, total length.

/// The content truncated to its own byteLength. Throws InputError if it is shorter than that.
std::span<const std::byte> trim_to_byte_length(std::span<const std::byte> bytes, std::size_t header_bytes,
                                               const std::string& name);

/// Throws InputError if the version differs from `expected`.
void require_version(std::span<const std::byte> bytes, std::uint32_t expected, const std::string& kind,
                     const std::string& name);

/// The sections between header and body, and the body.
struct TileTables {
  std::span<const std::byte> feature_json, feature_binary, batch_json, batch_binary;
  std::span<const std::byte> body;
};

/// Lengths of these sections, and of the header before them.
struct TileTableLengths {
  std::size_t header = 28;
  std::size_t feature_json = 0, feature_binary = 0, batch_json = 0, batch_binary = 0;
};

/// Reads the lengths from the header, starting at byte 12.
TileTableLengths read_table_lengths(std::span<const std::byte> tile, std::size_t header_bytes);

/// Throws InputError if the sections extend beyond the end.
TileTables split_tables(std::span<const std::byte> tile, const TileTableLengths& lengths, const std::string& name);

}  // namespace tileflight::tile_content
