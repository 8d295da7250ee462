#include "tileflight/tile_contents/tile_container.h"

#include <cstring>

#include "tileflight/base/input_error.h"
#include "tileflight/base/raw_bytes.h"

namespace tileflight::tile_contents {

using Bytes = std::span<const std::byte>;

std::uint32_t read_uint32_le(Bytes bytes, std::size_t offset) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

Bytes trim_to_byte_length(Bytes bytes, std::size_t header_bytes, const std::string& name) {
  if (bytes.size() < header_bytes) {
    throw InputError(name, "truncated: " + std::to_string(bytes.size()) + " bytes, but the header alone has " +
                               std::to_string(header_bytes));
  }
  const std::uint32_t length = read_uint32_le(bytes, 8);
  if (length > bytes.size()) {
    throw InputError(name, "truncated: " + std::to_string(bytes.size()) + " of " + std::to_string(length) + " bytes");
  }
  if (length < header_bytes)
    throw InputError(name, "its header gives a length of " + std::to_string(length) + " bytes");
  return bytes.first(length);
}

void require_version(Bytes bytes, std::uint32_t wanted, const std::string& kind, const std::string& name) {
  const std::uint32_t version = read_uint32_le(bytes, 4);
  if (version != wanted) {
    throw InputError(
        name, kind + " version " + std::to_string(version) + " is not supported, only " + std::to_string(wanted));
  }
}

TileTableLengths read_table_lengths(Bytes tile, std::size_t header_bytes) {
  return {header_bytes, read_uint32_le(tile, 12), read_uint32_le(tile, 16), read_uint32_le(tile, 20),
          read_uint32_le(tile, 24)};
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

}  // namespace tileflight::tile_contents
