#include "tileflight/tiles/tile_content/tile_container.h"

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"

namespace tileflight::tile_content {

using Bytes = std::span<const std::byte>;

Bytes trim_to_byte_length(Bytes bytes, std::size_t header_bytes, const std::string& name) {
  if (bytes.size() < header_bytes) {
    throw InputError(name, "truncated: " + std::to_string(bytes.size()) + " bytes, but the header alone has " +
                               std::to_string(header_bytes));
  }
  const std::uint32_t length = base::read_raw<std::uint32_t>(bytes, 8);
  if (length > bytes.size()) {
    throw InputError(name, "truncated: " + std::to_string(bytes.size()) + " of " + std::to_string(length) + " bytes");
  }
  if (length < header_bytes)
    throw InputError(name, "its header gives a length of " + std::to_string(length) + " bytes");
  return bytes.first(length);
}

void require_version(Bytes bytes, std::uint32_t expected, const std::string& kind, const std::string& name) {
  const std::uint32_t version = base::read_raw<std::uint32_t>(bytes, 4);
  if (version != expected) {
    throw InputError(
        name, kind + " version " + std::to_string(version) + " is not supported, only " + std::to_string(expected));
  }
}

TileTableLengths read_table_lengths(Bytes tile, std::size_t header_bytes) {
  return {header_bytes, base::read_raw<std::uint32_t>(tile, 12), base::read_raw<std::uint32_t>(tile, 16),
          base::read_raw<std::uint32_t>(tile, 20), base::read_raw<std::uint32_t>(tile, 24)};
}

TileTables split_tables(Bytes tile, const TileTableLengths& lengths, const std::string& name) {
  // Sums of five 32-bit numbers in 64 bits: no overflow.
  const std::size_t end =
      lengths.header + lengths.feature_json + lengths.feature_binary + lengths.batch_json + lengths.batch_binary;
  if (end > tile.size()) throw InputError(name, "its tables reach beyond the end of the file");
  Bytes rest = tile.subspan(lengths.header);
  const auto take = [&](std::size_t length) {
    const Bytes part = rest.first(length);
    rest = rest.subspan(length);
    return part;
  };
  TileTables tables;
  tables.feature_json = take(lengths.feature_json);
  tables.feature_binary = take(lengths.feature_binary);
  tables.batch_json = take(lengths.batch_json);
  tables.batch_binary = take(lengths.batch_binary);
  tables.body = rest;
  return tables;
}

}  // namespace tileflight::tile_content
